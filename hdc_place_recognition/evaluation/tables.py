# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""An evaluation as the content of metrics.json and as tables for people."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict

from hdc_place_recognition.evaluation.evaluate import Evaluation, Judgement, Ranking
import numpy as np

_JUDGED = (
    'closures_true',
    'closures_false',
    'closures_ignored',
    'queries_with_match',
    'precision',
    'recall',
)
_SUMMARY = (
    'images',
    'average_precision',
    'recall_at_1',
    'recall_at_5',
    'recall_at_full_precision',
    'area_best_match',
    'precision',
    'recall',
    'ms_per_image',
)


def metrics_dict(evaluation: Evaluation) -> dict[str, object]:
    """
    Return the content of metrics.json.

    Without ground truth, or where a metric has no meaning, its value is None. `closures` counts
    the accepted candidates whatever the ground truth says of them.
    """
    judged = evaluation.judgement
    return {
        'name': evaluation.dataset.name,
        **asdict(judged.ranking if judged else Ranking()),
        'closures': sum(candidate.accepted for candidate in evaluation.candidates),
        **(_judged(judged) if judged else dict.fromkeys(_JUDGED)),
        **asdict(evaluation.cost),
    }


def table(evaluation: Evaluation) -> str:
    """Return one evaluation as lines of metric and value."""
    rows = [('metric', 'value'), *_protocol(evaluation)]
    for name, value in metrics_dict(evaluation).items():
        if isinstance(value, dict):
            rows += [(f'{name} {stage}', _text(spent)) for stage, spent in value.items()]
        elif name != 'name':
            rows.append((name, _text(value)))
    return f'{evaluation.dataset.name}\n{_aligned(rows)}'


def summary(evaluations: Iterable[Evaluation]) -> str:
    """Return several evaluations as a table, a row each."""
    rows: list[Sequence[str]] = [('name', *_SUMMARY)]
    for evaluation in evaluations:
        values = metrics_dict(evaluation) | {'ms_per_image': evaluation.cost.ms_per_image['total']}
        rows.append((evaluation.dataset.name, *(_text(values[name]) for name in _SUMMARY)))
    return _aligned(rows)


def _judged(judgement: Judgement) -> dict[str, object]:
    """Return the metrics of the accepted candidates."""
    found = judgement.closures
    counts = (found.true, found.false, found.ignored, found.queries_with_match)
    return dict(zip(_JUDGED, (*counts, found.precision, found.recall), strict=True))


def _protocol(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Return what the metrics are about: the way of comparing, the truth, and how many pairs."""
    dataset, judged = evaluation.dataset, evaluation.judgement
    truth = dataset.ground_truth.summary if dataset.ground_truth else 'none'
    rows = [('mode', dataset.mode.value), ('ground truth', truth)]
    if judged:
        pairs = judged.pairs
        compared, same = np.count_nonzero(pairs.eligible), np.count_nonzero(pairs.positive)
        ignored = compared - np.count_nonzero(pairs.counted)
        rows.append(('pairs', f'{compared} compared: {same} to be found, {ignored} ignored'))
    return rows


def _text(value: object) -> str:
    if value is None:
        return '-'
    return f'{value:.3f}' if isinstance(value, float) else str(value)


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ('  '.join(map(str.ljust, row, widths)).rstrip() for row in rows)
    return '\n'.join(lines)
