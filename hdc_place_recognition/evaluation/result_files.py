# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Writes an evaluation to a results folder."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import csv
import json
from pathlib import Path

from hdc_place_recognition.evaluation.evaluate import Evaluation
from hdc_place_recognition.evaluation.metrics import best_match_curve, precision_recall
from hdc_place_recognition.params.formats import dump_yaml
from hdc_place_recognition.results import CANDIDATE_FIELDS

_CSV_FIELDS = tuple(column for column in CANDIDATE_FIELDS if column.in_csv)
CANDIDATE_COLUMNS = (
    'query_stamp_ns',
    'match_stamp_ns',
    *(column.name for column in _CSV_FIELDS),
    'truth',
)
CURVE_COLUMNS = ('curve', 'threshold', 'precision', 'recall')


def write_results(evaluation: Evaluation, output: Path) -> Path:
    """
    Write metrics.json, params.yaml, candidates.csv and precision_recall.csv.

    params.yaml is a valid --params-file for the node and the commands. precision_recall.csv has
    the points at which recall increases; the step-wise area under them equals the metric.

    :param evaluation: the evaluation.
    :param output: parent folder; a new subfolder is created, existing ones are not changed.
    :return: the new folder, <dataset name>_<number>.
    """
    folder = _new_folder(output, evaluation.dataset.name)
    metrics = json.dumps(evaluation.metrics, indent=2)
    (folder / 'metrics.json').write_text(metrics + '\n', encoding='utf-8')
    (folder / 'params.yaml').write_text(dump_yaml(evaluation.params), encoding='utf-8')
    _write_csv(folder / 'candidates.csv', CANDIDATE_COLUMNS, _candidate_rows(evaluation))
    _write_csv(folder / 'precision_recall.csv', CURVE_COLUMNS, _curve_rows(evaluation))
    return folder


def _new_folder(output: Path, name: str) -> Path:
    output.mkdir(parents=True, exist_ok=True)
    number = 1
    while True:
        folder = output / f'{name}_{number}'
        try:
            folder.mkdir()
        except FileExistsError:
            number += 1
        else:
            return folder


def _candidate_rows(evaluation: Evaluation) -> Iterable[Sequence[object]]:
    for candidate, label in zip(evaluation.candidates, evaluation.labels, strict=True):
        yield (
            candidate.query_stamp_ns,
            candidate.match_stamp_ns,
            *((column.text or column.get)(candidate) for column in _CSV_FIELDS),
            label.value if label else '',
        )


def _curve_rows(evaluation: Evaluation) -> Iterable[Sequence[object]]:
    if evaluation.scores is None:
        return
    for name, make in (('all_pairs', precision_recall), ('best_match', best_match_curve)):
        curve = make(evaluation.scores.pairs)
        if curve is not None:
            points = curve.steps()
            columns = (points.thresholds, points.precision, points.recall)
            yield from ((name, *map(float, point)) for point in zip(*columns, strict=True))


def _write_csv(file: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with file.open('w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(rows)
