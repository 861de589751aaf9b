# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which place of the memory each row of a database is in."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Order:
    """
    The places of rows, which are their own numbers until rows are taken out.

    Places stay without gaps: what is in the last one moves where a row was taken out.
    """

    def __init__(self) -> None:
        self._count = 0
        self._places: array[int] | None = None

    @property
    def row_nbytes(self) -> int:
        """Bytes of memory held by each row."""
        return 0 if self._places is None else self._places.itemsize

    def append(self) -> None:
        """Note that a new row is in the next place."""
        if self._places is not None:
            self._places.append(self._count)
        self._count += 1

    def place(self, row: int) -> int:
        """Return where a row is."""
        return row if self._places is None else self._places[row]

    def remove(self, row: int) -> None:
        """Note that a row was taken out, and the last place moved to its own."""
        last, place = self._count - 1, self.place(row)
        if self._places is None and row != last:
            self._places = array('q', range(self._count))
        if self._places is not None:
            self._places[int(np.flatnonzero(np.array(self._places) == last)[0])] = place
            del self._places[row]
        self._count = last

    def extent(self, rows: int) -> int:
        """Return how many places, from the first, hold the first rows."""
        return rows if self._places is None else self._count

    def places(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return where some rows are."""
        return rows if self._places is None else np.array(self._places, np.intp)[rows]

    def in_order(self, values: NDArray[Any], rows: int) -> NDArray[Any]:
        """Return of values (..., places) those of the first rows, in the order of rows."""
        if self._places is None:
            return values[..., :rows]
        return values[..., np.array(self._places[:rows], np.intp)]
