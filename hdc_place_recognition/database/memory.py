# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The keyframe database in memory."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Iterable

from hdc_place_recognition.database.base import (
    Added,
    Background,
    Keyframe,
    Match,
    Query,
    SearchResult,
)
from hdc_place_recognition.database.centering import RunningMeans
from hdc_place_recognition.database.eviction import Capacity, RedundancyPolicy
from hdc_place_recognition.database.search import (
    CenteredQuery,
    search_all,
    search_in_two_stages,
    Similarities,
)
from hdc_place_recognition.database.vector_store import SlotOrder, VectorStore
from hdc_place_recognition.features.compact import CompactKeypoints
from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np
from numpy.typing import NDArray

# Rows from which two stages are faster. On one core, exact against two stages: with 25 shifts 3.0
# and 3.6 ms at 1000 rows, 7.0 and 3.9 at 2048, 13.9 and 5.1 at 4096; with one shift 0.3 and 1.7,
# 1.0 and 2.0, 2.0 and 2.2 ms (hdc_benchmark).
TWO_STAGES_FROM = 2048
# With each new row the signs of this many older ones are taken again, against the mean of today:
# no row's signs are then against a mean of less than half the images. A power of 2: the rows lie
# in one chunk.
_REFRESHED = 2
# Keyframes that are this near to each other in their traverse show the same place.
_PLACE_RADIUS = 3
# The first and last keyframes of a traverse that were searched, if these are many.
_EDGE, _MANY = 2, 8


class MemoryDatabase:
    """
    Keyframes in memory, compared by the centered cosine under the best shift.

    Centering (paper, Sec. 3.1.4) subtracts the mean of all images seen so far: causal, nothing
    from the future. The stored vectors stay as they are.

    :param store: empty, for the vectors.
    :param shifts: s, number of shifts of a query.
    :param center: whether to subtract the means.
    :param groups: indices of shifts near to each other, for the first of two stages; all in one
        by default.
    :param capacity: beyond it the most redundant keyframes are evicted.
    """

    def __init__(
        self,
        store: VectorStore,
        shifts: int,
        center: bool,
        groups: tuple[tuple[int, ...], ...] = (),
        capacity: Capacity | None = None,
    ) -> None:
        self._center = center
        self._store, self._order, self._entries = store, SlotOrder(), _Entries()
        self._means = RunningMeans(shifts, store.dimensions)
        self._groups = groups or (tuple(range(shifts)),)
        self._refreshed = 0
        self._capacity = capacity or Capacity()
        self._policy = RedundancyPolicy(self._vector)
        self._added = 0

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def ids(self) -> tuple[int, ...]:
        """Return the ids of all keyframes, rising."""
        return tuple(self._entries.ids)

    @property
    def nbytes(self) -> int:
        """Return the bytes of memory that the keyframes take, without vectors in a file."""
        row = self._store.slot_nbytes + self._order.row_nbytes + self._policy.row_nbytes
        return len(self) * row + self._entries.nbytes

    @property
    def evicted_count(self) -> int:
        """Return how many keyframes were evicted or not taken since the start."""
        return self._added - len(self)

    def update_mean(self, query: Query) -> None:
        """Take an image into the means, whether it will be stored or not."""
        if self._center:
            self._means.update(query.vectors)

    def search(
        self,
        query: Query,
        k: int,
        *,
        before_ns: int | None = None,
        skip_newest: int = 0,
        without: int | None = None,
        also: Iterable[int] = (),
        exact: bool = False,
    ) -> SearchResult:
        """
        Return the k most similar keyframes, of equal ones the older first.

        From :data:`TWO_STAGES_FROM` keyframes on only those that the signs put first are compared
        exactly, unless `exact` is set.
        """
        count = self._searched(before_ns, skip_newest)
        if not count:
            return SearchResult(similarities=np.empty(0, np.float32))
        found = self._compare(CenteredQuery(query.vectors, self._means.of_queries()), count, exact)
        rows = self._best_rows(found.values, k, without)
        ids = [self._entries.ids[row] for row in rows]
        beside = {near for keyframe_id in ids for near in self.neighbors(keyframe_id)} | {*also}
        others = [self._entries.row(near) for near in sorted(beside - {without})]
        return SearchResult(
            matches=tuple(self._match(found, row) for row in rows),
            others={
                self._entries.ids[row]: self._match(found, row)
                for row in others
                if row is not None and row < count
            },
            background=Background.of(found.sample),
            similarities=found.values,
        )

    def get(self, keyframe_id: int) -> Keyframe:
        """
        Return a keyframe.

        :raises KeyError: there is none with this id, or it was evicted.
        """
        row = self._entries.row(keyframe_id)
        if row is None:
            raise KeyError(keyframe_id)
        entries = self._entries
        return Keyframe(
            stamp_ns=entries.stamps_ns[row],
            clock_ns=entries.clock_ns[row],
            vector=self._vector(row),
            keypoints=entries.keypoints[row],
            traverse=entries.traverses[row],
        )

    def neighbors(self, keyframe_id: int) -> tuple[int, ...]:
        """Return the ids before and after a keyframe in its traverse, as far as they exist."""
        return self._entries.near(keyframe_id, 1)

    def distance(self, first_id: int, second_id: int) -> int | None:
        """Return how many keyframes two are apart in their traverse; None if that is unknown."""
        return self._entries.distance(first_id, second_id)

    def add(self, keyframe: Keyframe) -> Added:
        """
        Store a keyframe; evict redundant ones while the database is over its capacity.

        If each stored keyframe is the only view of a place, the new one is evicted at once.

        :raises PlaceRecognitionError: there is no storage for it; nothing is changed.
        """
        mean, keyframe_id = self._means.of_keyframes(), self._added
        self._store.add(keyframe.vector, mean)
        self._order.append()
        if self._capacity:
            twin = keyframe.twin
            twin_row = None if twin is None else self._entries.row(twin)
            self._policy.add(keyframe.vector, twin, twin_row)
        self._entries.add(keyframe_id, keyframe)
        self._added += 1
        self._refresh_signs(mean)
        evicted = []
        while self._capacity and len(self) and self._capacity.exceeded(len(self), self.nbytes):
            row = self._policy.most_redundant()
            evicted.append(self._evict(len(self) - 1 if row is None else row))
        return Added(None if keyframe_id in evicted else keyframe_id, tuple(evicted))

    def _searched(self, before_ns: int | None, skip_newest: int) -> int:
        """Return how many rows are searched: the first ones."""
        old = len(self) if before_ns is None else self._entries.count_until(before_ns)
        return max(min(old, len(self) - skip_newest), 0)

    def _compare(self, query: CenteredQuery, count: int, exact: bool) -> Similarities:
        if exact or count < TWO_STAGES_FROM:
            return search_all(self._store, self._order, count, query)
        return search_in_two_stages(self._store, self._order, count, query, self._groups)

    def _best_rows(
        self, similarities: NDArray[np.float32], k: int, without: int | None
    ) -> list[int]:
        """Return the rows of the highest similarities, at most one of each place."""
        left = similarities.astype(np.float32, copy=True)
        excluded = None if without is None else self._entries.row(without)
        if excluded is not None and excluded < len(left):
            left[excluded] = -np.inf
        rows: list[int] = []
        while len(rows) < min(k, len(left)):
            row = int(np.argmax(left))
            if left[row] == -np.inf:
                break
            rows.append(row)
            left[row] = -np.inf
            for near in self._entries.near(self._entries.ids[row], _PLACE_RADIUS):
                near_row = self._entries.row(near)
                if near_row is not None and near_row < len(left):
                    left[near_row] = -np.inf
        return rows

    def _match(self, found: Similarities, row: int) -> Match:
        return Match(
            keyframe_id=self._entries.ids[row],
            similarity=float(found.values[row]),
            shift=int(found.shifts[row]),
            at_edge=self._entries.at_edge(row, len(found.values)),
        )

    def _refresh_signs(self, mean: Hypervector) -> None:
        start = self._refreshed if self._refreshed < len(self._store) else 0
        self._store.update_signs(start, mean, _REFRESHED)
        self._refreshed = start + _REFRESHED

    def _evict(self, row: int) -> int:
        """Remove a row and return the id of its keyframe."""
        keyframe_id = self._entries.ids[row]
        self._policy.evict(row, keyframe_id)
        self._store.remove(self._order.slot(row))
        self._order.remove(row)
        self._entries.remove(row)
        return keyframe_id

    def _vector(self, row: int) -> Hypervector:
        return self._store.vector(self._order.slot(row))


class _Entries:
    """All of the keyframes but their vectors: a row each, in the order of adding."""

    # Id, two stamps, traverse, the id in the order of its traverse, and a pointer to keypoints.
    _ROW_BYTES = 6 * 8

    def __init__(self) -> None:
        self.ids = array('q')
        self.stamps_ns = array('q')
        self.clock_ns = array('q')
        self.traverses = array('q')
        self.keypoints: list[CompactKeypoints | None] = []
        self._ids_of: dict[int, array[int]] = {}
        self._keypoint_bytes = 0

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def nbytes(self) -> int:
        """Return the bytes of memory held."""
        return len(self) * self._ROW_BYTES + self._keypoint_bytes

    def add(self, keyframe_id: int, keyframe: Keyframe) -> None:
        """Append a keyframe; ids and clock times rise."""
        self.ids.append(keyframe_id)
        self.stamps_ns.append(keyframe.stamp_ns)
        self.clock_ns.append(keyframe.clock_ns)
        self.traverses.append(keyframe.traverse)
        self.keypoints.append(keyframe.keypoints)
        self._ids_of.setdefault(keyframe.traverse, array('q')).append(keyframe_id)
        self._keypoint_bytes += 0 if keyframe.keypoints is None else keyframe.keypoints.nbytes

    def remove(self, row: int) -> None:
        """Remove a row; those after it move up."""
        keypoints, ids = self.keypoints[row], self._ids_of[self.traverses[row]]
        self._keypoint_bytes -= 0 if keypoints is None else keypoints.nbytes
        del ids[bisect_left(ids, self.ids[row])]
        for column in (self.ids, self.stamps_ns, self.clock_ns, self.traverses, self.keypoints):
            del column[row]

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

    def at_edge(self, row: int, count: int) -> bool:
        """Return whether a row is one of the first or last of its traverse in the first rows."""
        ids = self._ids_of[self.traverses[row]]
        searched = bisect_right(ids, self.ids[count - 1])
        place = bisect_left(ids, self.ids[row])
        return searched >= _MANY and not _EDGE <= place < searched - _EDGE

    def _place(self, keyframe_id: int) -> tuple[array[int], int] | None:
        """Return the ids of a keyframe's traverse and its index there, None if it is unknown."""
        row = self.row(keyframe_id)
        if row is None:
            return None
        ids = self._ids_of[self.traverses[row]]
        return ids, bisect_left(ids, keyframe_id)
