# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiment `hdc_experiments trust`: accepted closures and cost at one set of parameters."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hdc_place_recognition.datasets.dataset import Dataset, Mode, Truth
from hdc_place_recognition.datasets.folders import FolderImages
from hdc_place_recognition.datasets.ground_truth import MatrixTruth
from hdc_place_recognition.datasets.open_dataset import open_dataset
from hdc_place_recognition.evaluation.evaluate import evaluate_dataset, Evaluation, Scores
from hdc_place_recognition.evaluation.plots import draw_calibration, require_matplotlib
from hdc_place_recognition.evaluation.tables import aligned, number
from hdc_place_recognition.experiments.calibration import (
    best_candidates,
    LabeledScores,
    reliability,
)
from hdc_place_recognition.params.formats import add_arguments, from_arguments
import numpy as np

# Minimum age of candidates in seconds when a traverse is evaluated alone.
_TRAVERSE_GAP_S = 10.0
_STAGES = ('extract', 'encode', 'query', 'keypoints', 'verify')
_COLUMNS: Sequence[str] = (
    'run',
    'images',
    'true',
    'false',
    'ignored',
    'recall',
    'R@100P',
    'highest wrong',
    f'ms {_STAGES[0]}',
    *_STAGES[1:],
    'KB a keyframe',
)


def add_operating_point(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add the subcommand `trust`."""
    parser = subparsers.add_parser(
        'trust',
        help='show accepted closures, cost and calibration',
        description='Evaluate folders with gt.npz, traverses without revisits, and a reliability '
        'table of the score. The tables show accepted closures, recall and cost.',
    )
    parser.add_argument('data', nargs='+', type=Path, metavar='DATA_FOLDER')
    parser.add_argument(
        '--reversed',
        action='store_true',
        default=False,
        help='evaluate sequences in reverse order too',
    )
    parser.add_argument(
        '--plot', type=Path, default=None, metavar='FILE', help='write a reliability diagram'
    )
    add_arguments(parser)
    parser.set_defaults(run=run_operating_point)


def run_operating_point(arguments: argparse.Namespace) -> str:
    """
    Run the experiment and return its tables; the reliability table covers all runs.

    :raises PlaceRecognitionError: an input or a parameter is invalid.
    """
    # With one thread the time of each stage equals its CPU time.
    params = from_arguments(arguments).replace(threads=1)
    if arguments.plot:
        require_matplotlib()
    rows, labeled = [_COLUMNS], []
    for path in arguments.data:
        for dataset in _datasets(open_dataset(path), arguments.reversed):
            evaluation = evaluate_dataset(dataset, params)
            rows += _rows(evaluation)
            if evaluation.scores:
                labeled.append(best_candidates(evaluation))
    pooled = LabeledScores(
        np.concatenate([run.scores for run in labeled]),
        np.concatenate([run.true for run in labeled]),
    )
    if arguments.plot:
        draw_calibration(pooled.scores, pooled.true, arguments.plot)
    return '\n'.join([*aligned(rows), '', *reliability(pooled)])


def _datasets(dataset: Dataset, with_reversed: bool) -> Iterator[Dataset]:
    """Yield the dataset, its single traverses, and if wanted the reversed sequence."""
    yield dataset
    if dataset.mode is Mode.TRAVERSES and dataset.reference is not None:
        overrides = {**dataset.overrides, 'exclude_recent_s': _TRAVERSE_GAP_S}
        for name, frames in (('reference', dataset.reference), ('query', dataset.queries)):
            yield Dataset(
                f'{dataset.name}, {name} alone', Mode.SEQUENCE, frames, overrides=overrides
            )
    if with_reversed and dataset.mode is Mode.SEQUENCE:
        yield from _reversed(dataset)


def _reversed(dataset: Dataset) -> Iterator[Dataset]:
    """Yield the images of a folder in reverse order, with the ground truth to match."""
    frames, ground_truth = dataset.queries, dataset.ground_truth
    if not (isinstance(frames, FolderImages) and ground_truth):
        return
    stamps_ns = frames.stamps_ns
    truth = ground_truth.truth(stamps_ns, stamps_ns)
    # gt.npz may list only pairs with an older image, so both directions are combined.
    hard, soft = ((matrix | matrix.T)[::-1, ::-1] for matrix in (truth.hard, truth.soft))
    yield replace(
        dataset,
        name=f'{dataset.name}, backwards',
        queries=FolderImages(frames.files[::-1]),
        ground_truth=MatrixTruth(Truth(hard, soft), stamps_ns, stamps_ns),
    )


def _rows(evaluation: Evaluation) -> Iterator[Sequence[str]]:
    """Yield the table row of a run, and a row for its images before the first revisit."""
    name, scores = evaluation.dataset.name, evaluation.scores
    n_images, costs = len(evaluation.run_log.detections), _costs(evaluation)
    if scores is None:
        yield _row_without_revisits(evaluation, name, n_images, costs)
        return
    closures, best = scores.closures, best_candidates(evaluation)
    yield (
        name,
        *map(str, (n_images, closures.true, closures.false, closures.ignored)),
        number(closures.recall),
        number(scores.ranking.recall_at_full_precision),
        _highest(best.scores[~best.true].tolist()),
        *costs,
    )
    n_before = _images_before_revisit(scores)
    if evaluation.dataset.mode is Mode.SEQUENCE and n_before:
        name = f'{name}, before any revisit'
        yield _row_without_revisits(evaluation, name, n_before, ['-'] * len(costs))


def _row_without_revisits(
    evaluation: Evaluation, name: str, n_images: int, costs: Sequence[str]
) -> Sequence[str]:
    """Return the row of the first images, which revisit no place: every closure is false."""
    detections = evaluation.run_log.detections[:n_images]
    n_false = sum(len(detection.accepted) for detection in detections)
    best = [detection.candidates[0].score for detection in detections if detection.candidates]
    return (name, str(n_images), '0', str(n_false), '0', '-', '-', _highest(best), *costs)


def _images_before_revisit(scores: Scores) -> int:
    """Return the number of images before the first one that revisits a place; 0 if none does."""
    pairs = scores.pairs
    revisits = ((pairs.hard | pairs.soft) & pairs.eligible).any(axis=1)
    return int(revisits.argmax())


def _costs(evaluation: Evaluation) -> list[str]:
    """Return milliseconds of each stage and kilobytes of a keyframe as table cells."""
    cost = evaluation.cost
    n_keyframes = max(len(evaluation.run_log.image_of_keyframe), 1)
    milliseconds = [f'{cost.ms_per_image[stage]:.1f}' for stage in _STAGES]
    return [*milliseconds, f'{cost.database_bytes / 1000 / n_keyframes:.1f}']


def _highest(scores: Sequence[float]) -> str:
    """Return the highest score as a table cell."""
    return number(max(scores, default=None))
