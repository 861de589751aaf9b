# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""An evaluation as a folder of files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import csv
import json
from pathlib import Path

from hdc_place_recognition.evaluation.evaluate import Evaluation
from hdc_place_recognition.evaluation.metrics import best_match_curve, precision_recall
from hdc_place_recognition.evaluation.tables import metrics_dict
from hdc_place_recognition.params.formats import dump_yaml

CANDIDATE_COLUMNS = (
    'query_stamp_ns',
    'match_stamp_ns',
    'match_id',
    'similarity',
    'score',
    'inliers',
    'accepted',
    'reason',
    'shift_x',
    'shift_y',
    'qx',
    'qy',
    'qz',
    'qw',
    'truth',
)
_UNKNOWN = ('',) * 4
CURVE_COLUMNS = ('curve', 'threshold', 'precision', 'recall')


def write_results(evaluation: Evaluation, output: Path) -> Path:
    """
    Write metrics.json, params.yaml, candidates.csv and precision_recall.csv.

    params.yaml can be given back as --params-file, to the node too. precision_recall.csv holds
    the points at which recall rises: the area under them by steps is the metric.

    :param evaluation: what to write.
    :param output: folder of results; a new folder in it is made, none is overwritten.
    :return: the new folder, <name>_<n>.
    """
    folder = _new_folder(output, evaluation.dataset.name)
    metrics = json.dumps(metrics_dict(evaluation), indent=2)
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
    for each, verdict in zip(evaluation.candidates, evaluation.verdicts, strict=True):
        yield (
            each.query_stamp_ns,
            each.match_stamp_ns,
            each.match_id,
            each.similarity,
            each.score,
            each.inliers,
            int(each.accepted),
            each.reason.value,
            each.shift_x,
            each.shift_y,
            *(each.rotation or _UNKNOWN),
            verdict.value if verdict else '',
        )


def _curve_rows(evaluation: Evaluation) -> Iterable[Sequence[object]]:
    if evaluation.judgement is None:
        return
    for name, of in (('all_pairs', precision_recall), ('best_match', best_match_curve)):
        curve = of(evaluation.judgement.pairs)
        if curve is not None:
            points = curve.steps()
            columns = (points.thresholds, points.precision, points.recall)
            yield from ((name, *map(float, point)) for point in zip(*columns, strict=True))


def _write_csv(file: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with file.open('w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(rows)
