# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiment `hdc_experiments trust`: accepted closures, cost and calibration, set by set."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
import csv
from dataclasses import dataclass, replace
from itertools import groupby
import logging
from pathlib import Path
from typing import Any

from hdc_place_recognition.datasets.dataset import Frames, Mode
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.evaluate import evaluate_dataset, Evaluation, Scores
from hdc_place_recognition.evaluation.metrics import Label
from hdc_place_recognition.evaluation.plots import draw_calibration, require_matplotlib
from hdc_place_recognition.evaluation.progress import with_progress_bar
from hdc_place_recognition.evaluation.tables import aligned, number
from hdc_place_recognition.experiments.calibration import (
    best_candidates,
    fit,
    labeled_evidence,
    LabeledScores,
    reliability,
)
from hdc_place_recognition.experiments.trust_runs import (
    ALL,
    Choices,
    Run,
    runs_against,
    runs_of,
)
from hdc_place_recognition.params.formats import add_arguments, from_arguments
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import calibrations
from hdc_place_recognition.results import Frame
from hdc_place_recognition.verification.settings import Calibration
import numpy as np

_log = logging.getLogger(__name__)

Row = Sequence[str]
_TRUSTED = 0.95  # the score whose precision is judged
_STAGES = ('extract', 'encode', 'query', 'keypoints', 'verify')
_HIGHEST = 'highest wrong'
_COLUMNS: Row = (
    'run',
    'images',
    'to find',
    'true',
    'false',
    'ignored',
    'precision',
    'recall',
    'with soft',
    'R@100P',
    'AP',
    'R@1',
    'proposed',
    _HIGHEST,
    f'ms {_STAGES[0]}',
    *_STAGES[1:],
    'KB a keyframe',
)
_FALSE_COLUMNS: Row = ('false closure', 'query', 'match', 'frames off', 'score', 'inliers')
_FOLD_COLUMNS: Row = (
    'left out',
    'slope',
    'center',
    'trusted',
    'precision',
    'shipped: trusted',
    'precision',
)


@dataclass(frozen=True)
class RunResult:
    """
    What is kept of a run.

    :param folder: name of the set.
    :param variant: what is different, empty for the plain set.
    :param rows: of the main table.
    :param false: rows of the table of false closures.
    :param to_find: number of queries with a match.
    :param labeled: scores of the best candidates.
    :param shipped: the calibration of these scores.
    """

    folder: str
    variant: str
    rows: tuple[Row, ...]
    false: tuple[Row, ...]
    to_find: int
    labeled: LabeledScores
    shipped: Calibration


def add_operating_point(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add the subcommand `trust`."""
    parser = subparsers.add_parser(
        'trust',
        help='show accepted closures, cost and calibration',
        description='Evaluate sets of images, each traverse alone, and harder variants. The '
        'tables show accepted closures and cost, every false closure, the calibration with one '
        'set left out, and the reliability of the score. Give the folders before the options.',
    )
    add = parser.add_argument
    add('data', nargs='+', type=Path, metavar='DATA_FOLDER')
    add(
        '--roll',
        nargs='+',
        type=float,
        action='append',
        default=[],
        metavar='DEGREES',
        help='turn revisits by random angles from LOW to HIGH, or up to HIGH; can be repeated',
    )
    add('--seeds', type=int, default=3, help='runs with different random angles (default 3)')
    add('--zoom', nargs='+', type=float, default=[], metavar='FACTOR', help='zoom revisits')
    add('--shift', action='store_true', help='shift revisits by a third')
    add('--thin', nargs='+', type=int, default=[], metavar='N', help='take every n-th image')
    add('--reversed', action='store_true', help='evaluate in reverse order too')
    add('--swapped', action='store_true', help='exchange map and queries of two traverses')
    add('--against', action='store_true', help='compare each set with other sets')
    add('--all', action='store_true', help='evaluate all of these variants')
    add('--queries', type=int, default=0, metavar='N', help='at most N queries of two traverses')
    add('--csv', type=Path, default=None, metavar='FILE', help='write the first table')
    add(
        '--plot',
        type=Path,
        default=None,
        metavar='FILE',
        help='write a reliability diagram for each set: FILE with the name of the set',
    )
    add_arguments(parser)
    parser.set_defaults(run=run_operating_point)


def run_operating_point(arguments: argparse.Namespace) -> str:
    """
    Run the experiment and return its tables.

    :raises PlaceRecognitionError: an input or a parameter is invalid.
    """
    # With one thread the time of each stage equals its CPU time.
    params, choices = from_arguments(arguments).replace(threads=1), _choices(arguments)
    if arguments.plot:
        require_matplotlib()
    results = [_result(run, params) for run in _runs(arguments.data, choices)]
    if arguments.csv:
        _write_csv(results, arguments.csv)
    if arguments.plot:
        _draw(results, arguments.plot)
    return '\n'.join(_tables(results))


def _choices(arguments: argparse.Namespace) -> Choices:
    """Return the variants to evaluate."""
    if arguments.all:
        return replace(ALL, seeds=arguments.seeds, queries=arguments.queries)
    return Choices(
        rolls=[_range(angles) for angles in arguments.roll],
        seeds=arguments.seeds,
        zooms=arguments.zoom,
        shift=arguments.shift,
        thin=arguments.thin,
        reverse=arguments.reversed,
        swap=arguments.swapped,
        against=arguments.against,
        queries=arguments.queries,
    )


def _range(angles: Sequence[float]) -> tuple[float, float]:
    """Return the smallest and largest angle of --roll."""
    if len(angles) > 2:
        raise PlaceRecognitionError(f'--roll {angles}: give one or two angles')
    return (0.0, angles[0]) if len(angles) == 1 else (angles[0], angles[1])


def _runs(paths: Sequence[Path], choices: Choices) -> Iterator[Run]:
    """Yield all runs, set by set."""
    for path in paths:
        yield from runs_of(path, choices)
    yield from runs_against(paths, choices)


def _result(run: Run, params: Params) -> RunResult:
    """Evaluate one run; keep what the tables need."""

    def progress(frames: Frames, label: str) -> Iterable[Frame]:
        del label
        return with_progress_bar(frames, len(frames), run.name, 'image')

    evaluation = evaluate_dataset(run.dataset, params, progress)
    scores = evaluation.scores
    assert scores is not None  # every run has ground truth
    found = scores.closures
    _log.info(
        '%s: true %d, false %d, ignored %d, recall %s',
        *(run.name, found.true, found.false, found.ignored, number(found.recall)),
    )
    verified, unverified = calibrations(evaluation.identity)
    return RunResult(
        run.folder,
        run.variant,
        tuple(_rows(run, evaluation, scores)),
        tuple(_false_rows(run, evaluation, scores)),
        found.queries_with_match,
        best_candidates(evaluation),
        verified if params.verify else unverified,
    )


def _rows(run: Run, evaluation: Evaluation, scores: Scores) -> Iterator[Row]:
    """Yield the table row of a run, and a row for its images before the first revisit."""
    closures, ranking, best = scores.closures, scores.ranking, best_candidates(evaluation)
    yield (
        run.name,
        *map(str, (len(evaluation.run_log.detections), closures.queries_with_match)),
        *map(str, (closures.true, closures.false, closures.ignored)),
        *map(number, (closures.precision, closures.recall)),
        number(_share(scores, _queries_with(evaluation, scores, Label.TRUE, Label.IGNORED))),
        number(ranking.recall_at_full_precision),
        *map(number, (ranking.average_precision, ranking.recall_at_1)),
        number(_share(scores, _queries_with(evaluation, scores, Label.TRUE, accepted=False))),
        _highest(best.scores[~best.true].tolist()),
        *_costs(evaluation),
    )
    n_before = _images_before_revisit(scores) if closures.queries_with_match else 0
    if evaluation.dataset.mode is Mode.SEQUENCE and n_before and not run.same_start:
        yield _row_before_revisit(run, evaluation, n_before)


def _row_before_revisit(run: Run, evaluation: Evaluation, n_images: int) -> Row:
    """Return the row of the first images, which revisit no place: every closure is false."""
    detections = evaluation.run_log.detections[:n_images]
    n_false = sum(len(detection.accepted) for detection in detections)
    best = [detection.candidates[0].score for detection in detections if detection.candidates]
    row = (f'{run.name}, before any revisit', str(n_images), '0', '0', str(n_false), '0')
    unknown = ['-'] * (_COLUMNS.index(_HIGHEST) - len(row))
    return (*row, *unknown, _highest(best), *['-'] * (len(_STAGES) + 1))


def _queries_with(
    evaluation: Evaluation, scores: Scores, *labels: Label, accepted: bool = True
) -> set[int]:
    """Return the queries that have a candidate with one of the labels, accepted or any."""
    cells = evaluation.run_log.cells()
    return {
        query
        for (query, _), label, found in zip(
            cells, scores.labels, evaluation.candidates, strict=True
        )
        if label in labels and (found.accepted or not accepted)
    }


def _share(scores: Scores, queries: set[int]) -> float | None:
    """Return the share of the queries with a match that are among the given ones."""
    to_find = set(np.flatnonzero(scores.pairs.has_match).tolist())
    return len(queries & to_find) / len(to_find) if to_find else None


def _false_rows(run: Run, evaluation: Evaluation, scores: Scores) -> Iterator[Row]:
    """Yield a row for each false closure, with its distance from the nearest hard match."""
    positive = scores.pairs.positive
    labeled = zip(evaluation.run_log.cells(), scores.labels, evaluation.candidates, strict=True)
    for (query, match), label, found in labeled:
        if found.accepted and label is Label.FALSE:
            right = np.flatnonzero(positive[query])
            off = str(np.abs(right - match).min()) if len(right) else '-'
            yield (run.name, str(query), str(match), off, number(found.score), str(found.inliers))


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


def _main_rows(results: Sequence[RunResult]) -> Iterator[Row]:
    """Yield the rows of the main table; runs of several seeds are followed by their mean."""
    for (folder, variant), group in groupby(results, lambda run: (run.folder, run.variant)):
        rows = [run.rows for run in group]
        yield from (row for found in rows for row in found)
        if len(rows) > 1:
            yield _mean_row(f'{folder}, {variant} (mean)', [found[0] for found in rows])


def _mean_row(name: str, rows: Sequence[Row]) -> Row:
    """Return the mean of each column, '-' where a value is missing; of scores the highest."""
    cells = [name]
    for title, *column in list(zip(_COLUMNS, *rows, strict=True))[1:]:
        values = [float(cell) for cell in column if cell != '-']
        value = max(values, default=0.0) if title == _HIGHEST else sum(values) / len(rows)
        decimals = max(1, *(len(cell.partition('.')[2]) for cell in column))
        cells.append(f'{value:.{decimals}f}' if len(values) == len(rows) else '-')
    return cells


def _tables(results: Sequence[RunResult]) -> list[str]:
    """Return the lines of all tables."""
    lines = aligned([_COLUMNS, *_main_rows(results)])
    false = [row for result in results for row in result.false]
    lines += ['', *(aligned([_FALSE_COLUMNS, *false]) if false else ['no false closure'])]
    plain = {result.folder: result for result in results if not result.variant}
    variants = {folder: _pooled(results, folder) for folder in plain}
    if len(plain) > 1:
        folds = [row for folder in plain for row in _folds(folder, plain, variants[folder])]
        lines += ['', *aligned([_FOLD_COLUMNS, *folds])]
    for folder, result in plain.items():
        lines += ['', f'reliability: {folder}', *reliability(result.labeled)]
        if len(variants[folder].scores):
            lines += ['', f'reliability: {folder}, variants', *reliability(variants[folder])]
    return lines


def _pooled(results: Sequence[RunResult], folder: str) -> LabeledScores:
    """Return the scores of the variants of a set that revisit places."""
    found = [
        result.labeled
        for result in results
        if result.folder == folder and result.variant and result.to_find
    ]
    return LabeledScores(
        np.concatenate([np.empty(0), *(labeled.scores for labeled in found)]),
        np.concatenate([np.empty(0, np.bool_), *(labeled.true for labeled in found)]),
    )


def _folds(folder: str, plain: Mapping[str, RunResult], variants: LabeledScores) -> Iterator[Row]:
    """
    Yield the rows of a set, and of its variants, calibrated on the other plain sets.

    There are none if the best candidates of the other sets are all true or all false.
    """
    evidence = [
        labeled_evidence(result.labeled, result.shipped)
        for name, result in plain.items()
        if name != folder
    ]
    try:
        fitted, shipped = fit(evidence), plain[folder].shipped
    except PlaceRecognitionError:
        return
    calibration = (f'{fitted.slope:.2f}', f'{fitted.center:.2f}')
    for name, labeled in ((folder, plain[folder].labeled), (f'{folder}, variants', variants)):
        if len(labeled.scores):
            scores = [fitted.score(shipped.evidence(score)) for score in labeled.scores]
            rescored = replace(labeled, scores=np.array(scores))
            yield (name, *calibration, *_trusted(rescored), *_trusted(labeled))


def _trusted(labeled: LabeledScores) -> tuple[str, str]:
    """Return how many best candidates have a score of at least .95, and their precision."""
    true = labeled.true[labeled.scores >= _TRUSTED]
    return str(len(true)), number(float(true.mean()) if len(true) else None)


def _write_csv(results: Sequence[RunResult], file: Path) -> None:
    """Write the main table."""
    with file.open('w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(_COLUMNS)
        writer.writerows(_main_rows(results))


def _draw(results: Sequence[RunResult], file: Path) -> None:
    """Draw a reliability diagram for each set."""
    for result in results:
        if not result.variant:
            target = file.with_name(f'{file.stem}_{result.folder}{file.suffix}')
            draw_calibration(result.labeled.scores, result.labeled.true, target)
