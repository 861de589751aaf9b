# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The means that centring (Sec. 3.1.4) subtracts, of the images seen so far."""

from __future__ import annotations

from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np
from numpy.typing import NDArray


class Means:
    """
    The mean of all queries so far under each displacement; 0 before the first.

    :param forms: s, of a query.
    :param dimensions: d.
    """

    def __init__(self, forms: int, dimensions: int) -> None:
        self._sums = np.zeros((forms, dimensions))
        self.seen = 0

    def see(self, query: Hypervector) -> None:
        """Take in the forms (s, d) of an image."""
        self._sums += query
        self.seen += 1

    def of_forms(self) -> NDArray[np.float64]:
        """Return (s, d)."""
        return self._sums / max(self.seen, 1)

    def sum_of_rows(self) -> NDArray[np.float64]:
        """Return (d,), the sum of the middle forms."""
        return self._sums[len(self._sums) // 2].copy()

    def of_rows(self) -> NDArray[np.float32]:
        """Return (d,), that of the middle forms."""
        total, share = self._sums[len(self._sums) // 2], 1 / max(self.seen, 1)
        return np.multiply(total, share, dtype=np.float32, casting='same_kind')
