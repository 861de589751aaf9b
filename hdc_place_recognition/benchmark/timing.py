# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What a benchmark measures with, and what it measures against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

# More than any cache holds.
_READ_BYTES = 256 << 20
# A product of matrices as large as they are fastest.
_MULTIPLIED = 1024, 4096


@dataclass(frozen=True)
class Measurement:
    """
    One line of the benchmark.

    :param value: in the unit.
    :param ratio: to the reference, which was measured in the same run; None without one.
    :param target: what the ratio should be, in words.
    """

    name: str
    value: float
    unit: str
    ratio: float | None = None
    reference: str = ''
    target: str = ''


def milliseconds(run: Callable[[], object], repeats: int = 5) -> float:
    """Return the least time of some runs after a first one: what others do is no part of it."""
    run()
    return min(each_milliseconds(run, repeats))


def each_milliseconds(run: Callable[[], object], repeats: int) -> list[float]:
    """Return how long each of some runs takes."""
    spent = []
    for _ in range(repeats):
        start = perf_counter()
        run()
        spent.append((perf_counter() - start) * 1e3)
    return spent


def read_bandwidth() -> float:
    """Return how many bytes a millisecond one core reads from memory."""
    numbers = np.ones(_READ_BYTES // 4, np.float32)
    return _READ_BYTES / milliseconds(numbers.max)


def multiplication_rate() -> float:
    """Return how many products of float32 are added up in a millisecond at best, on one core."""
    rows, columns = _MULTIPLIED
    one, other = np.ones((rows, columns), np.float32), np.full((rows, columns), 2, np.float32)
    return rows * rows * columns / milliseconds(lambda: one @ other.T)
