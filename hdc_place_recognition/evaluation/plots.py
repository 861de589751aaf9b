# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Plots of an evaluation. Matplotlib (extra `plot`) is imported when a plot is drawn."""

from __future__ import annotations

from collections.abc import Collection
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hdc_place_recognition.datasets.dataset import Frames
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.evaluate import Evaluation, Scores
from hdc_place_recognition.evaluation.metrics import best_match_curve, Label, precision_recall
from hdc_place_recognition.evaluation.run_log import NOT_FOUND
from hdc_place_recognition.results import Candidate
import numpy as np
from numpy.typing import NDArray

_SHOWN_PAIRS = 4
_CALIBRATION_BINS = 10
_CONTRAST = (2.0, 99.8)  # percentiles of similarity drawn as white and black
# A palette for color-blind readers (Okabe and Ito).
_COLORS = {
    Label.TRUE: '#0072b2',
    Label.FALSE: '#d55e00',
    Label.IGNORED: '#999999',
    None: '#0072b2',
}


def require_matplotlib() -> None:
    """
    Check that matplotlib is installed, before a long run.

    :raises PlaceRecognitionError: it is not installed.
    """
    if find_spec('matplotlib') is None:
        raise PlaceRecognitionError(
            'plots need the package matplotlib, which is not installed: '
            "pip install 'hdc_place_recognition[plot]'"
        )


def draw(evaluation: Evaluation, folder: Path) -> None:
    """
    Draw the similarity matrix with matched images, and the precision-recall curves.

    :param evaluation: the evaluation.
    :param folder: output folder of closures.png and, with ground truth, precision_recall.png.
    """
    _draw_closures(evaluation, folder / 'closures.png')
    if evaluation.scores is not None:
        _draw_curves(evaluation, evaluation.scores, folder / 'precision_recall.png')


def draw_calibration(scores: NDArray[np.float64], true: NDArray[np.bool_], file: Path) -> None:
    """
    Draw a reliability diagram: share of true closures over predicted score, in ten bins.

    :param scores: (n,) predicted probabilities.
    :param true: (n,) bool, True for a true closure.
    :param file: output image file.
    """
    bins = np.minimum((scores * _CALIBRATION_BINS).astype(int), _CALIBRATION_BINS - 1)
    counts = np.bincount(bins, minlength=_CALIBRATION_BINS)
    filled = np.flatnonzero(counts)
    predicted = (np.bincount(bins, scores, _CALIBRATION_BINS) / np.maximum(counts, 1))[filled]
    observed = (np.bincount(bins, true, _CALIBRATION_BINS) / np.maximum(counts, 1))[filled]
    figure = _figure(4.5, 4.5)
    axes = figure.add_subplot(xlabel='score', ylabel='share of true closures', aspect='equal')
    axes.plot([0, 1], [0, 1], color='#999999', linewidth=1)
    axes.plot(predicted, observed, marker='o', color=_COLORS[Label.TRUE])
    for x, y, count in zip(predicted, observed, counts[filled], strict=True):
        axes.annotate(str(count), (x, y), xytext=(4, -10), textcoords='offset points', fontsize=7)
    figure.savefig(file)


def _figure(width: float, height: float) -> Any:
    """Return a new figure; the size is in inches."""
    require_matplotlib()
    # Not pyplot: it keeps every figure in memory.
    from matplotlib.figure import Figure

    return Figure((width, height), dpi=120, layout='constrained')


def _draw_curves(evaluation: Evaluation, scores: Scores, file: Path) -> None:
    """Draw both precision-recall curves and the operating point."""
    figure = _figure(4.5, 4)
    axes = figure.subplots()
    curves = {
        'all pairs': precision_recall(scores.pairs),
        'best match per query': best_match_curve(scores.pairs),
    }
    for name, curve in curves.items():
        if curve is not None:
            axes.plot(curve.recall, curve.precision, label=f'{name}: area {curve.area:.3f}')
    closures = scores.closures
    if closures.precision is not None and closures.recall is not None:
        axes.plot(closures.recall, closures.precision, 'k*', label='accepted', clip_on=False)
    axes.set(
        xlabel='recall',
        ylabel='precision',
        xlim=(0, 1),
        ylim=(0, 1.02),
        title=evaluation.dataset.name,
    )
    axes.legend(loc='lower left')
    figure.savefig(file)


def _draw_closures(evaluation: Evaluation, file: Path) -> None:
    """Draw the similarity matrix and some matched image pairs."""
    pairs = _shown_pairs(evaluation)
    figure = _figure(11 if pairs else 5.5, 5)
    left, *right = figure.subfigures(1, 2 if pairs else 1, squeeze=False)[0]
    _draw_matrix(left.subplots(), evaluation)
    if pairs:
        _draw_pairs(right[0], evaluation, pairs)
    figure.savefig(file)


def _draw_matrix(axes: Any, evaluation: Evaluation) -> None:
    """Draw the similarity matrix with a ring around each accepted candidate."""
    run_log = evaluation.run_log
    similarities = run_log.similarity_matrix()
    known = run_log.eligible & (similarities > NOT_FOUND)
    low, high = np.percentile(similarities[known], _CONTRAST) if known.any() else (0, 1)
    picture = axes.imshow(
        np.where(known, similarities, np.nan),
        cmap='gray_r',
        vmin=low,
        vmax=high,
        interpolation='nearest',
    )
    axes.figure.colorbar(picture, ax=axes, label='similarity', shrink=0.8, extend='both')
    cells = np.array(run_log.cells(accepted_only=True)).reshape(-1, 2)
    labels = [label for _, label in _accepted(evaluation)]
    for label, color in _COLORS.items():
        columns, rows = cells[[found is label for found in labels]].T[::-1]
        if len(rows):
            text = f'{len(rows)} {label.value if label else "accepted"}'
            axes.scatter(columns, rows, s=24, facecolors='none', edgecolors=color, label=text)
            axes.legend(loc='upper right', title='closures')
    axes.set(xlabel='database image', ylabel='query image', title=evaluation.dataset.name)


def _accepted(evaluation: Evaluation) -> list[tuple[Candidate, Label | None]]:
    """Return the accepted candidates in the order of the queries, best first."""
    labeled = zip(evaluation.candidates, evaluation.labels, strict=True)
    return [(candidate, label) for candidate, label in labeled if candidate.accepted]


def _shown_pairs(evaluation: Evaluation) -> list[tuple[Candidate, Label | None]]:
    """Return the best accepted candidates of four queries at equal distances in the run."""
    best: dict[int, tuple[Candidate, Label | None]] = {}
    for candidate, label in _accepted(evaluation):
        best.setdefault(candidate.query_stamp_ns, (candidate, label))
    found = list(best.values())
    chosen = np.linspace(0, len(found) - 1, min(_SHOWN_PAIRS, len(found)))
    return [found[index] for index in np.rint(chosen).astype(int)]


def _draw_pairs(
    figure: Any, evaluation: Evaluation, pairs: list[tuple[Candidate, Label | None]]
) -> None:
    """Draw each query next to its match; the frame color shows the label."""
    dataset = evaluation.dataset
    queries = _images(dataset.queries, {pair.query_stamp_ns for pair, _ in pairs})
    database = dataset.queries if dataset.reference is None else dataset.reference
    matches = _images(database, {pair.match_stamp_ns for pair, _ in pairs})
    for row, (pair, label) in zip(
        figure.subplots(len(pairs), 2, squeeze=False), pairs, strict=True
    ):
        images = (queries[pair.query_stamp_ns], matches[pair.match_stamp_ns])
        match = f'match at {_seconds(pair.match_stamp_ns)}, similarity {pair.similarity:.2f}'
        titles = (f'query at {_seconds(pair.query_stamp_ns)}', match)
        for axes, image, title in zip(row, images, titles, strict=True):
            axes.imshow(image)
            axes.set_title(title, fontsize=8)
            axes.set(xticks=[], yticks=[])
            for edge in axes.spines.values():
                edge.set(color=_COLORS[label], linewidth=2)


def _seconds(stamp_ns: int) -> str:
    return f'{stamp_ns / 1e9:.2f} s'


def _images(frames: Frames, stamps_ns: Collection[int]) -> dict[int, NDArray[np.uint8]]:
    """Return the images with the given stamps as RGB."""
    return {frame.stamp_ns: _rgb(frame.image) for frame in frames if frame.stamp_ns in stamps_ns}


def _rgb(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    if image.ndim == 2:
        return np.stack([image] * 3, axis=-1)
    return image[..., ::-1]
