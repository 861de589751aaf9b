# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs of an experiment over seeds as a table: means and their 95 % intervals."""

from __future__ import annotations

from collections.abc import Sequence

from hdc_place_recognition.offline.experiment_runs import Run
from hdc_place_recognition.offline.experiment_variants import Variant
import numpy as np

# Student's t at 97.5 % for 1 to 30 degrees of freedom; beyond, the last is 4 % too wide at most.
# fmt: off
_T = (
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
    2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086,
    2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
)
# fmt: on


def half_interval(values: Sequence[float]) -> float | None:
    """Return half the width of the mean's 95 % t-interval; None for a single value."""
    if len(values) < 2:
        return None
    t = _T[min(len(values) - 1, len(_T)) - 1]
    return float(t * np.std(values, ddof=1) / np.sqrt(len(values)))


def markdown(runs: Sequence[Run], variants: Sequence[Variant]) -> str:
    """
    Return the comparison as a markdown table, a row for each variant.

    :param runs: of the variants, each on the same data sets with the same seeds.
    :param variants: in the order of the rows.
    """
    datasets = list(dict.fromkeys(run.dataset for run in runs))
    rows = [('variant', 'changes', *datasets, 'mean AP', 'verdict', 'why')]
    for variant in variants:
        changes = ' '.join(f'{name}={value}' for name, value in variant.changes.items())
        own = [run for run in runs if run.variant == variant.name]
        cells = [_cell([run for run in own if run.dataset == name]) for name in datasets]
        rows.append((variant.name, changes, *cells, _mean(own), variant.verdict, variant.why))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, tuple('-' * width for width in widths))
    lines = (' | '.join(map(str.ljust, row, widths)) for row in rows)
    return '\n'.join(f'| {line} |' for line in lines)


def _cell(runs: Sequence[Run]) -> str:
    recall = np.mean([run.recall_at_1 for run in runs])
    return f'{_with_interval([run.average_precision for run in runs])}, {recall:.2f}'


def _mean(runs: Sequence[Run]) -> str:
    """Return the mean over data sets; its interval is over seeds, each a mean over data sets."""
    seeds = sorted({run.seed for run in runs})
    means = [
        float(np.mean([run.average_precision for run in runs if run.seed == seed]))
        for seed in seeds
    ]
    return _with_interval(means)


def _with_interval(values: Sequence[float]) -> str:
    half = half_interval(values)
    return f'{np.mean(values):.3f}' + ('' if half is None else f' ± {half:.3f}')
