# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The means that centering (paper, Sec. 3.1.4) subtracts, of the images seen so far."""

from __future__ import annotations

from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np
from numpy.typing import NDArray


class RunningMeans:
    """
    The mean of all queries so far under each shift; 0 before the first query.

    The mean is causal: it knows no image from the future.

    :param shifts: s, number of shifts of a query.
    :param dimensions: d.
    """

    def __init__(self, shifts: int, dimensions: int) -> None:
        self._sums = np.zeros((shifts, dimensions))
        self._count = 0

    def update(self, vectors: Hypervector) -> None:
        """Add the descriptors (s, d) of an image."""
        self._sums += vectors
        self._count += 1

    def of_queries(self) -> NDArray[np.float64]:
        """Return (s, d) float64, the mean under each shift."""
        return self._sums / max(self._count, 1)

    def of_keyframes(self) -> NDArray[np.float32]:
        """Return (d,) float32, the mean under the zero shift."""
        total, share = self._sums[len(self._sums) // 2], 1 / max(self._count, 1)
        return np.multiply(total, share, dtype=np.float32, casting='same_kind')
