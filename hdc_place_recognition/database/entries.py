# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What a database keeps of its keyframes besides their vectors, and how they follow each other."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right

from hdc_place_recognition.database.base import Keyframe
from hdc_place_recognition.features.cells import Cells
from hdc_place_recognition.features.compact import CompactKeypoints
import numpy as np
from numpy.typing import NDArray

NO_WORDS = -1


class Entries:
    """A row for each keyframe, in the order of adding; ids and clock times rise."""

    # Id, two stamps, traverse, the id in the order of its traverse, word slot, and pointers to
    # keypoints and cells.
    _ROW_BYTES = 5 * 8 + 4 + 2 * 8

    def __init__(self) -> None:
        self.ids = array('q')
        self.stamps_ns = array('q')
        self.clock_ns = array('q')
        self.traverses = array('q')
        self.word_slots = array('i')
        self.keypoints: list[CompactKeypoints | None] = []
        self.cells: list[Cells | None] = []
        self._ids_of: dict[int, array[int]] = {}
        self._object_bytes = 0

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def nbytes(self) -> int:
        """Return the bytes of memory held."""
        return len(self) * self._ROW_BYTES + self._object_bytes

    def add(self, keyframe_id: int, keyframe: Keyframe, word_slot: int) -> None:
        """Append a keyframe; `word_slot` is NO_WORDS if it has none."""
        self.ids.append(keyframe_id)
        self.stamps_ns.append(keyframe.stamp_ns)
        self.clock_ns.append(keyframe.clock_ns)
        self.traverses.append(keyframe.traverse)
        self.word_slots.append(word_slot)
        self.keypoints.append(keyframe.keypoints)
        self.cells.append(keyframe.cells)
        self._ids_of.setdefault(keyframe.traverse, array('q')).append(keyframe_id)
        self._object_bytes += self._bytes_of(len(self) - 1)

    def remove(self, row: int) -> None:
        """Remove a row; those after it move up."""
        ids = self._ids_of[self.traverses[row]]
        del ids[bisect_left(ids, self.ids[row])]
        self._object_bytes -= self._bytes_of(row)
        for column in (self.ids, self.stamps_ns, self.clock_ns, self.traverses, self.word_slots):
            del column[row]
        del self.keypoints[row], self.cells[row]

    def row(self, keyframe_id: int) -> int | None:
        """Return the row of a keyframe, None if it is not stored."""
        row = bisect_left(self.ids, keyframe_id)
        return row if row < len(self) and self.ids[row] == keyframe_id else None

    def count_until(self, clock_ns: int) -> int:
        """Return how many keyframes are of this clock time or earlier: the first ones."""
        return bisect_right(self.clock_ns, clock_ns)

    def near(self, keyframe_id: int, radius: int) -> tuple[int, ...]:
        """Return the ids up to so many keyframes before and after one in its traverse, rising."""
        found = self._place(keyframe_id)
        if found is None:
            return ()
        ids, place = found
        first, after, end = max(place - radius, 0), place + 1, place + 1 + radius
        return (*ids[first:place], *ids[after:end])

    def distance(self, first_id: int, second_id: int) -> int | None:
        """Return how many keyframes two of a traverse are apart; None if that is unknown."""
        first, second = self._place(first_id), self._place(second_id)
        if first is None or second is None or first[0] is not second[0]:
            return None
        return abs(first[1] - second[1])

    def other_visits(self, traverse: int, before_ns: int) -> NDArray[np.int64]:
        """Return the ids of other traverses, and those of this clock time or before, rising."""
        ids = np.array(self.ids, np.int64)
        if self._ids_of.keys() <= {traverse}:
            return ids[: self.count_until(before_ns)]
        other = np.array(self.traverses) != traverse
        return ids[other | (np.array(self.clock_ns) <= before_ns)]

    def oldest(self, row: int) -> bool:
        """Return whether a row is one of the first two of its traverse."""
        return self.ids[row] in self._ids_of[self.traverses[row]][:2]

    def rows_near(self, row: int, radius: int) -> list[int]:
        """Return the rows up to so many keyframes before and after one in its traverse."""
        if self._one_traverse:
            first, end = max(row - radius, 0), min(row + radius + 1, len(self))
            return [near for near in range(first, end) if near != row]
        rows = (self.row(near) for near in self.near(self.ids[row], radius))
        return [near for near in rows if near is not None]

    def rows_of(self, traverse: int, first: int, end: int) -> NDArray[np.intp]:
        """Return the rows from `first` to `end` that are of a traverse."""
        rows = np.arange(first, end)
        if self._ids_of.keys() <= {traverse}:
            return rows
        return rows[np.array(self.traverses[first:end]) == traverse]

    @property
    def _one_traverse(self) -> bool:
        """Return whether all rows are of one traverse, and so follow each other."""
        return len(self._ids_of) == 1

    def _bytes_of(self, row: int) -> int:
        held = (self.keypoints[row], self.cells[row])
        return sum(part.nbytes for part in held if part is not None)

    def _place(self, keyframe_id: int) -> tuple[array[int], int] | None:
        """Return the ids of a keyframe's traverse and its index there, None if it is unknown."""
        row = self.row(keyframe_id)
        if row is None:
            return None
        ids = self._ids_of[self.traverses[row]]
        return ids, row if self._one_traverse else bisect_left(ids, keyframe_id)
