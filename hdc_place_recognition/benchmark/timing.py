# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Measuring times, and the limits of the machine as references."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

# Larger than any cache.
_READ_BYTES = 256 << 20
# Matrix sizes at which the product is fastest.
_MULTIPLIED = 1024, 4096


@dataclass(frozen=True)
class Measurement:
    """
    One line of the benchmark.

    :param value: measured value, in `unit`.
    :param ratio: ratio to the reference, which is measured in the same run; None without one.
    :param target: the target of the ratio, as text.
    """

    name: str
    value: float
    unit: str
    ratio: float | None = None
    reference: str = ''
    target: str = ''


def milliseconds(run: Callable[[], object], repeats: int = 5) -> float:
    """Return the least time of some runs after a warm-up, which excludes the load of others."""
    run()
    return min(each_milliseconds(run, repeats))


def each_milliseconds(run: Callable[[], object], repeats: int) -> list[float]:
    """Return the time of each run."""
    spent = []
    for _ in range(repeats):
        start = perf_counter()
        run()
        spent.append((perf_counter() - start) * 1e3)
    return spent


def read_bandwidth() -> float:
    """Return the read bandwidth of one core, bytes per millisecond."""
    numbers = np.ones(_READ_BYTES // 4, np.float32)
    return _READ_BYTES / milliseconds(numbers.max)


def multiplication_rate() -> float:
    """Return the multiply-add rate of one core in float32, operations per millisecond."""
    rows, columns = _MULTIPLIED
    a, b = np.ones((rows, columns), np.float32), np.full((rows, columns), 2, np.float32)
    return rows * rows * columns / milliseconds(lambda: a @ b.T)
