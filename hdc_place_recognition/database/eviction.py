# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The capacity of a database, and which keyframe is evicted when it is exceeded."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass

from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np
from numpy.typing import NDArray

# Cosine from which two images are views of one place. On lip6_outdoor_part1 half of successive
# keyframes are above 0.56, and 5 % of images of different places above 0.3.
SAME_PLACE = 0.3
_NO_TWIN, _UNLIKE = -1, -1.0


@dataclass(frozen=True)
class Capacity:
    """
    The most that a database may hold; 0 is no limit.

    :param keyframes: number of keyframes.
    :param megabytes: memory, MB.
    """

    keyframes: int = 0
    megabytes: float = 0.0

    def __bool__(self) -> bool:
        return self.keyframes > 0 or self.megabytes > 0

    def exceeded(self, keyframes: int, nbytes: int) -> bool:
        """Return whether so many keyframes or bytes are too many."""
        return 0 < self.keyframes < keyframes or 0 < self.megabytes < nbytes / 1e6


class RedundancyPolicy:
    """
    Finds the keyframe that is most similar to another one, so that no place is lost.

    A keyframe is compared with the one before it, the one after it, and its twin: the older
    keyframe that was most similar to it when it was added. Rows are in the order of adding.

    :param vector: returns the (d,) vector of a row.
    """

    def __init__(self, vector: Callable[[int], Hypervector]) -> None:
        self._vector = vector
        self._before = array('d')
        self._twin = array('q')
        self._twin_cosine = array('d')

    @property
    def row_nbytes(self) -> int:
        """Return the bytes of memory of a row."""
        return 3 * 8 if self._before else 0

    def add(self, vector: Hypervector, twin: int | None, twin_row: int | None) -> None:
        """
        Note a new row.

        :param vector: (d,) float32, its vector.
        :param twin: id of its twin, None if it has none.
        :param twin_row: the row of the twin, None if it was evicted.
        """
        newest = len(self._before) - 1
        self._before.append(_UNLIKE if newest < 0 else float(vector @ self._vector(newest)))
        if twin is None or twin_row is None:
            self._twin.append(_NO_TWIN)
            self._twin_cosine.append(_UNLIKE)
        else:
            self._twin.append(twin)
            self._twin_cosine.append(float(vector @ self._vector(twin_row)))

    def most_redundant(self) -> int | None:
        """
        Return the row most similar to another one; None if each is the only view of a place.

        Of two neighbors that are similar to each other, it is the one that is also more similar to
        its other neighbor. Of a keyframe and its twin it is the keyframe: the first view stays.
        """
        before = np.array(self._before)
        after = np.append(before[1:], _UNLIKE)
        highest_of_row = np.maximum(np.maximum(before, after), self._twin_cosine)
        highest = highest_of_row.max()
        if highest < SAME_PLACE:
            return None
        other_side = np.where(highest_of_row == highest, np.minimum(before, after), -np.inf)
        return int(other_side.argmax())

    def evict(self, row: int, keyframe_id: int) -> None:
        """Remove a row before its vector is removed; it is no longer the twin of others."""
        if row + 1 < len(self._before):
            closed = float(self._vector(row - 1) @ self._vector(row + 1)) if row else _UNLIKE
            self._before[row + 1] = closed
        for values in (self._before, self._twin, self._twin_cosine):
            del values[row]
        orphans: NDArray[np.intp] = np.flatnonzero(np.array(self._twin) == keyframe_id)
        for orphan in orphans.tolist():
            self._twin[orphan], self._twin_cosine[orphan] = _NO_TWIN, _UNLIKE
