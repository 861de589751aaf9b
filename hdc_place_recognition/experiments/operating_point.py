# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiment that shows what closures can be trusted with: at one setting, on all data."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hdc_place_recognition.datasets.dataset import Dataset, Mode, Truth
from hdc_place_recognition.datasets.folders import FolderImages
from hdc_place_recognition.datasets.ground_truth import MatrixTruth
from hdc_place_recognition.datasets.open_dataset import open_dataset, Options
from hdc_place_recognition.evaluation.evaluate import evaluate, Evaluation
from hdc_place_recognition.evaluation.plots import draw_calibration, require_matplotlib
from hdc_place_recognition.experiments.calibration import best_candidates, Outcomes, reliability
from hdc_place_recognition.params.formats import add_arguments, from_arguments
from hdc_place_recognition.recognition.factory import create_recognizer, use_threads
from hdc_place_recognition.results import Candidate
import numpy as np

# Images of one traverse, looked at by itself, are compared with those so many older.
_TRAVERSE_GAP = 10.0
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


def add_trust(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add the experiment to the command hdc_experiments."""
    parser = subparsers.add_parser(
        'trust',
        help='accepted closures, their cost, and the calibration on all data',
        description='Print accepted closures, recall and cost on folders with gt.npz, on what '
        'never revisits a place, and predicted against observed scores.',
    )
    parser.add_argument('data', nargs='+', type=Path, metavar='DATA_FOLDER')
    parser.add_argument(
        '--reversed', action='store_true', default=False, help='sequences backwards too'
    )
    parser.add_argument(
        '--plot', type=Path, default=None, metavar='FILE', help='draw the calibration into a file'
    )
    add_arguments(parser)
    parser.set_defaults(run=run_trust)


def run_trust(arguments: argparse.Namespace) -> str:
    """Return the tables; the calibration is of all runs together."""
    params = from_arguments(arguments)
    if arguments.plot:
        require_matplotlib()
    rows, outcomes = [_COLUMNS], []
    for path in arguments.data:
        for dataset in _runs(open_dataset(path, None, Options()), arguments.reversed):
            # On one thread the time that each stage takes is its time of the CPU.
            one_thread = params.replace(**dataset.overrides, threads=1)
            use_threads(one_thread)
            recognizer = create_recognizer(one_thread)
            evaluation = evaluate(dataset, recognizer)
            rows += _rows(evaluation)
            if evaluation.judgement:
                outcomes.append(best_candidates(evaluation))
    together = Outcomes(
        np.concatenate([each.scores for each in outcomes]),
        np.concatenate([each.true for each in outcomes]),
    )
    if arguments.plot:
        draw_calibration(together.scores, together.true, arguments.plot)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ['  '.join(map(str.ljust, row, widths)).rstrip() for row in rows]
    return '\n'.join([*lines, '', *reliability(together)])


def _runs(dataset: Dataset, backwards: bool) -> Iterator[Dataset]:
    """Yield a data set, each of its traverses by itself, and its sequence backwards."""
    yield dataset
    if dataset.mode is Mode.TRAVERSES and dataset.reference is not None:
        alone = {**dataset.overrides, 'exclude_recent_s': _TRAVERSE_GAP}
        for name, frames in (('reference', dataset.reference), ('query', dataset.queries)):
            yield Dataset(f'{dataset.name}, {name} alone', Mode.SEQUENCE, frames, overrides=alone)
    if backwards and dataset.mode is Mode.SEQUENCE:
        yield from _backwards(dataset)


def _backwards(dataset: Dataset) -> Iterator[Dataset]:
    """Yield the sequence of a folder from its end to its beginning."""
    frames, truth = dataset.queries, dataset.ground_truth
    if not (isinstance(frames, FolderImages) and truth):
        return
    stamps_ns = frames.stamps_ns
    forwards = truth.truth(stamps_ns, stamps_ns)
    hard, soft = ((each | each.T)[::-1, ::-1] for each in (forwards.hard, forwards.soft))
    yield replace(
        dataset,
        name=f'{dataset.name}, backwards',
        queries=FolderImages(frames.files[::-1]),
        ground_truth=MatrixTruth(Truth(hard, soft), stamps_ns, stamps_ns),
    )


def _rows(evaluation: Evaluation) -> Iterator[Sequence[str]]:
    """Yield the row of a run, and that of its first images if they show no place twice."""
    judged, cost = evaluation.judgement, evaluation.cost
    accepted = evaluation.recording.cells(accepted_only=True)
    kilobytes = cost.database_bytes / 1000 / max(len(evaluation.recording.image_of_row), 1)
    costs = [f'{cost.ms_per_image[stage]:.1f}' for stage in _STAGES] + [f'{kilobytes:.1f}']
    name, images = evaluation.dataset.name, len(evaluation.recording.detections)
    if judged is None:
        wrong = _highest(best.score for best in _best(evaluation))
        yield (name, str(images), '0', str(len(accepted)), '0', '-', '-', wrong, *costs)
        return
    found, ranking = judged.closures, judged.ranking
    counts = [str(count) for count in (images, found.true, found.false, found.ignored)]
    outcomes = best_candidates(evaluation)
    wrong = _highest(outcomes.scores[~outcomes.true])
    recalls = [
        '-' if value is None else f'{value:.3f}'
        for value in (found.recall, ranking.recall_at_full_precision)
    ]
    yield (name, *counts, *recalls, wrong, *costs)
    ever = ((judged.pairs.hard | judged.pairs.soft) & judged.pairs.eligible).any(axis=1)
    never = int(ever.argmax())
    if evaluation.dataset.mode is Mode.SEQUENCE and never:
        early = [query for query, _ in accepted if query < never]
        wrong = _highest(best.score for best in _best(evaluation, never))
        rest = ['-'] * len(costs)
        name = f'{name}, before any revisit'
        yield (name, str(never), '0', str(len(early)), '0', '-', '-', wrong, *rest)


def _best(evaluation: Evaluation, queries: int | None = None) -> list[Candidate]:
    """Return the best candidate of each of the first queries, where there is one."""
    detections = evaluation.recording.detections[:queries]
    return [detection.candidates[0] for detection in detections if detection.candidates]


def _highest(scores: Iterable[float]) -> str:
    """Return the highest score, of those that should be low."""
    highest = max(scores, default=None)
    return '-' if highest is None else f'{highest:.3f}'
