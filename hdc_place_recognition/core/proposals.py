# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which rows are worth a closer look."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Rows this near to a better one show the same place.
_RADIUS = 3


def propose(similarities: NDArray[np.float32], count: int, skip_id: int | None) -> list[int]:
    """
    Return the rows of the highest similarities, best first; of equals the older first.

    Of rows near to each other in time only the best is taken.

    :param similarities: (n,).
    :param count: rows at most.
    :param skip_id: a row that is none.
    """
    left = similarities.astype(np.float32, copy=True)
    if skip_id is not None and skip_id < len(left):
        left[skip_id] = -np.inf
    rows: list[int] = []
    while len(rows) < min(count, len(left)):
        row = int(np.argmax(left))
        if left[row] == -np.inf:
            break
        rows.append(row)
        near = slice(max(row - _RADIUS, 0), row + _RADIUS + 1)
        left[near] = -np.inf
    return rows


def neighbours(row: int, rows: int) -> list[int]:
    """Return the rows before and after one, of those there are."""
    return [near for near in (row - 1, row + 1) if 0 <= near < rows]
