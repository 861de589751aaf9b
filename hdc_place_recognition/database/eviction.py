# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""How much a database may hold, and what it lets go."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass

from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Forgotten:
    """An image that is no longer in the database: the row it had, and its number."""

    row: int
    keyframe_id: int


@dataclass(frozen=True)
class Limit:
    """
    What a database may hold; 0 is no limit.

    :param keyframes: images.
    :param megabytes: of memory.
    """

    keyframes: int = 0
    megabytes: float = 0.0

    def __bool__(self) -> bool:
        return self.keyframes > 0 or self.megabytes > 0

    def exceeded(self, keyframes: int, nbytes: int) -> bool:
        """Return whether this is more than may be held."""
        return 0 < self.keyframes < keyframes or 0 < self.megabytes < nbytes / 1e6


# Cosine from which two images are views of one place. On lip6_outdoor_part1 half of successive
# keyframes are above 0.56, and 5 % of images of different places above 0.3.
ALIKE = 0.3
_NO_TWIN, _UNLIKE = -1, -1.0


class Redundancy:
    """
    How like the images of a database are to those before and after, and to an older visit.

    Rows are in the order of adding; an image's twin is the older one it looked most like.

    :param vector: returns the (d,) vector of a row.
    """

    def __init__(self, vector: Callable[[int], Hypervector]) -> None:
        self._vector = vector
        self._before = array('d')
        self._twin = array('q')
        self._twin_cosine = array('d')

    @property
    def row_nbytes(self) -> int:
        """Bytes of memory held by each row."""
        return 3 * 8 if self._before else 0

    def add(self, current: Hypervector, twin: int | None, twin_row: int | None) -> None:
        """
        Note a new row.

        :param current: (d,) float32, its vector.
        :param twin: number of the keyframe that is its twin, None if there is none.
        :param twin_row: where that is, None if it was forgotten.
        """
        newest = len(self._before) - 1
        self._before.append(_UNLIKE if newest < 0 else float(current @ self._vector(newest)))
        if twin is None or twin_row is None:
            self._twin.append(_NO_TWIN)
            self._twin_cosine.append(_UNLIKE)
        else:
            self._twin.append(twin)
            self._twin_cosine.append(float(current @ self._vector(twin_row)))

    def most_redundant(self) -> int | None:
        """
        Return the row that is most like another one; None if each is the only view of a place.

        Of two that are like each other, that which is also more like its other neighbour; of an
        image and its twin the image, so that the first view of a place stays.
        """
        before = np.array(self._before)
        after = np.append(before[1:], _UNLIKE)
        likest = np.maximum(np.maximum(before, after), self._twin_cosine)
        highest = likest.max()
        if highest < ALIKE:
            return None
        return int(np.where(likest == highest, np.minimum(before, after), -np.inf).argmax())

    def forget(self, row: int, keyframe_id: int) -> None:
        """Take a row out before it goes; it is nobody's twin any more."""
        if row + 1 < len(self._before):
            closed = float(self._vector(row - 1) @ self._vector(row + 1)) if row else _UNLIKE
            self._before[row + 1] = closed
        for values in (self._before, self._twin, self._twin_cosine):
            del values[row]
        lost: NDArray[np.intp] = np.flatnonzero(np.array(self._twin) == keyframe_id)
        for other in lost.tolist():
            self._twin[other], self._twin_cosine[other] = _NO_TWIN, _UNLIKE
