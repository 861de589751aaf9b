# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Shifts of the image under which a query is compared.

Binding features to positions makes the descriptor sensitive to shifts of the view. The query is
therefore encoded under several shifts of its features, and the similarity to a keyframe is that of
the best shift. The database stores one vector a keyframe, the one without shift.
"""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Shifts:
    """
    A regular grid of shifts around the zero shift.

    :param count_x: number of horizontal shifts, odd; 1 for none.
    :param count_y: number of vertical shifts, odd.
    :param step: distance between two shifts, as a share of the image's width or height.
    :raises PlaceRecognitionError: a count is even: the grid would have no zero shift.
    """

    count_x: int
    count_y: int
    step: float

    def __post_init__(self) -> None:
        for name in ('count_x', 'count_y'):
            if (count := getattr(self, name)) % 2 == 0:
                raise PlaceRecognitionError(
                    f'shifts: {name} {count} is even, so none of them is the zero shift; '
                    f'use {count - 1} or {count + 1}'
                )

    @property
    def x(self) -> NDArray[np.float32]:
        """Return (count_x,) horizontal shifts, shares of the width."""
        return _symmetric(self.count_x, self.step)

    @property
    def y(self) -> NDArray[np.float32]:
        """Return (count_y,) vertical shifts, shares of the height."""
        return _symmetric(self.count_y, self.step)

    @property
    def offsets(self) -> NDArray[np.float32]:
        """Return all shifts as (x, y), (count_y * count_x, 2); the zero shift is in the middle."""
        x, y = np.meshgrid(self.x, self.y)
        return np.stack([x.ravel(), y.ravel()], axis=1)

    @property
    def zero(self) -> int:
        """Return the index of the zero shift."""
        return self.count_x * self.count_y // 2

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """
        Return indices of shifts in blocks of 3 x 3 that overlap by one.

        The bundle of a block is similar to whatever one of its members is similar to.
        """
        index = np.arange(self.count_x * self.count_y).reshape(self.count_y, self.count_x)
        blocks = (
            index[np.ix_(rows, columns)]
            for rows in _overlapping(self.count_y)
            for columns in _overlapping(self.count_x)
        )
        return tuple(tuple(block.ravel().tolist()) for block in blocks)

    def shift_x(self, x: NDArray[np.float32], width: int) -> NDArray[np.float32]:
        """Return (k,) horizontal positions in pixels under each shift, (count_x, k)."""
        return np.add.outer(self.x * np.float32(width), x)

    def shift_y(self, y: NDArray[np.float32], height: int) -> NDArray[np.float32]:
        """Return (k,) vertical positions in pixels under each shift, (count_y, k)."""
        return np.add.outer(self.y * np.float32(height), y)


NO_SHIFTS = Shifts(1, 1, 0.0)


def _overlapping(count: int) -> list[range]:
    """Return ranges of three that overlap by one, or one range if there are fewer."""
    return [range(first, min(first + 3, count)) for first in range(0, max(count - 2, 1), 2)]


def _symmetric(count: int, step: float) -> NDArray[np.float32]:
    return ((np.arange(count) - count // 2) * step).astype(np.float32)
