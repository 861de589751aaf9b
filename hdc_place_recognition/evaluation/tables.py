# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Text tables of evaluations for a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from hdc_place_recognition.evaluation.evaluate import Evaluation
import numpy as np

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


def table(evaluation: Evaluation) -> str:
    """Return one evaluation as a table with one line per metric."""
    rows = [('metric', 'value'), *_conditions(evaluation)]
    for name, value in evaluation.metrics.items():
        if isinstance(value, dict):
            rows += [(f'{name} {stage}', number(mean)) for stage, mean in value.items()]
        elif name != 'name':
            rows.append((name, number(value)))
    return '\n'.join([evaluation.dataset.name, *aligned(rows)])


def summary(evaluations: Iterable[Evaluation]) -> str:
    """Return several evaluations as a table with one line per evaluation."""
    rows: list[Sequence[str]] = [('name', *_SUMMARY)]
    for evaluation in evaluations:
        values = evaluation.metrics | {'ms_per_image': evaluation.cost.ms_per_image['total']}
        rows.append((evaluation.dataset.name, *(number(values[name]) for name in _SUMMARY)))
    return '\n'.join(aligned(rows))


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return one line per row, with columns padded to equal width."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ['  '.join(map(str.ljust, row, widths)).rstrip() for row in rows]


def number(value: object) -> str:
    """Return a table cell: three decimals for a float, '-' for None."""
    if value is None:
        return '-'
    return f'{value:.3f}' if isinstance(value, float) else str(value)


def _conditions(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Return the mode, the ground truth and the number of pairs as table rows."""
    dataset = evaluation.dataset
    truth = dataset.ground_truth.summary if dataset.ground_truth else 'none'
    rows = [('mode', dataset.mode.value), ('ground truth', truth)]
    if evaluation.scores:
        pairs = evaluation.scores.pairs
        compared, same = np.count_nonzero(pairs.eligible), np.count_nonzero(pairs.positive)
        ignored = compared - np.count_nonzero(pairs.counted)
        rows.append(('pairs', f'{compared} compared: {same} to be found, {ignored} ignored'))
    return rows
