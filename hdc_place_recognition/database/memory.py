# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The keyframe database in memory."""

from __future__ import annotations

from hdc_place_recognition.database.base import (
    Added,
    Background,
    Keyframe,
    Query,
    SearchResult,
)
from hdc_place_recognition.database.centering import RunningMeans
from hdc_place_recognition.database.entries import Entries, NO_WORDS
from hdc_place_recognition.database.eviction import Capacity, RedundancyPolicy
from hdc_place_recognition.database.fusion import FULL_DEVIATIONS, fuse
from hdc_place_recognition.database.matches import Matches
from hdc_place_recognition.database.search import (
    CenteredQuery,
    search_all,
    search_in_two_stages,
    Similarities,
)
from hdc_place_recognition.database.vector_store import SlotOrder, VectorStore
from hdc_place_recognition.database.word_index import WordIndex
from hdc_place_recognition.hdc.algebra import Hypervector
from hdc_place_recognition.hdc.words import WORDS
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
# Rows that words put first and that are compared exactly, besides those that the signs put first.
_COMPARED_BY_WORDS = 16


class MemoryDatabase:
    """
    Keyframes in memory, found by vectors and by words.

    Vectors are compared by the centered cosine under the best shift.

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
        self._store, self._order, self._entries = store, SlotOrder(), Entries()
        self._words: WordIndex | None = None
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
        words = 0 if self._words is None else self._words.nbytes
        return len(self) * row + self._entries.nbytes + words

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
        exact: bool = False,
    ) -> SearchResult:
        """
        Return the k most distinct keyframes, of equal ones the older first.

        From :data:`TWO_STAGES_FROM` keyframes on only those that the signs put first are compared
        exactly, unless `exact` is set.
        """
        count = self._searched(before_ns, skip_newest)
        if not count:
            return SearchResult(similarities=np.empty(0, np.float32))
        words = self._word_similarities(query, count)
        centered = CenteredQuery(query.vectors, self._means.of_queries())
        found = self._compare(centered, count, exact, words)
        background = Background.of(found.sample)
        distinctness = fuse(found.values, background, words)
        excluded = None if without is None else self._entries.row(without)
        matches = Matches(self._entries, found, distinctness, query.traverse, excluded)
        joint = found.values if words is None else distinctness / np.float32(FULL_DEVIATIONS)
        return SearchResult(
            matches=matches.best(distinctness, k),
            by_words=() if words is None else matches.best(words, k),
            find=matches.find,
            background=background,
            similarities=joint,
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
            cells=entries.cells[row],
            traverse=entries.traverses[row],
        )

    def near(self, keyframe_id: int, radius: int) -> tuple[int, ...]:
        """Return the ids up to so many keyframes before and after one in its traverse, rising."""
        return self._entries.near(keyframe_id, radius)

    def other_visits(self, traverse: int, before_ns: int) -> NDArray[np.int64]:
        """Return the ids of other traverses, and those of this clock time or before, rising."""
        return self._entries.other_visits(traverse, before_ns)

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
        self._entries.add(keyframe_id, keyframe, self._index_words(keyframe))
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

    def _word_similarities(self, query: Query, count: int) -> NDArray[np.float32] | None:
        """Return (count,) similarities of words; None without words."""
        if query.words is None or self._words is None:
            return None
        # The last element is that of keyframes without words.
        by_slot = np.append(self._words.similarities(query.words), np.float32(0))
        return by_slot[np.array(self._entries.word_slots[:count])]

    def _compare(
        self,
        query: CenteredQuery,
        count: int,
        exact: bool,
        words: NDArray[np.float32] | None,
    ) -> Similarities:
        if exact or count < TWO_STAGES_FROM:
            return search_all(self._store, self._order, count, query)
        also = np.empty(0, np.intp)
        if words is not None:
            also = np.argpartition(-words, _COMPARED_BY_WORDS)[:_COMPARED_BY_WORDS]
        return search_in_two_stages(self._store, self._order, count, query, self._groups, also)

    def _index_words(self, keyframe: Keyframe) -> int:
        """Return the slot of a keyframe's words in the index."""
        if keyframe.words is None:
            return NO_WORDS
        if self._words is None:
            self._words = WordIndex(WORDS)
        return self._words.add(keyframe.words)

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
        if self._words is not None and (slot := self._entries.word_slots[row]) != NO_WORDS:
            self._words.remove(slot)
        self._entries.remove(row)
        return keyframe_id

    def _vector(self, row: int) -> Hypervector:
        return self._store.vector(self._order.slot(row))
