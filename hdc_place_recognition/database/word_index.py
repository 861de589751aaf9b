# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Inverted lists: the keyframes that contain a word.

Each word has one list of slots in a common pool. A full list moves to a block half as large
again, after the slots of removed keyframes are dropped. The list of a word that too many keyframes
contain is given up, since such a word tells little. A query reads the lists of its rarest words,
up to a fixed number of entries. So neither memory nor time grows without bound.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Entries that one query reads at most: 3 ms on one core.
ENTRIES_READ = 200_000
# A longer list is given up, and its word counts for nothing from then on.
_LONGEST = 4096
_GIVEN_UP = -1
_FIRST_CAPACITY = 4
# The pool grows in place (realloc moves pages, not bytes) by as many entries as a few images fill.
_POOL_STEP = 1 << 18
_FIRST_SLOTS = 1024
_LEAST_LENGTH = 1e-9
# Each new keyframe sweeps this share of the words for removed keyframes; after one round the slots
# removed before it are free.
_SWEEPS = 512


class WordIndex:
    """
    Finds keyframes by their words. A keyframe has a slot, which is used again after its removal.

    :param words: number of different words.
    :param entries_read: number of list entries that one query reads at most.
    """

    def __init__(self, words: int, entries_read: int = ENTRIES_READ) -> None:
        self._entries_read = entries_read
        self._start = np.zeros(words, np.int32)
        self._count = np.zeros(words, np.int16)
        self._capacity = np.zeros(words, np.int16)
        # Number of keyframes that contain a word, with those removed since the last sweep.
        self._frequency = np.zeros(words, np.int32)
        self._pool = np.zeros(_POOL_STEP, np.int32)
        self._used = 0
        self._free_blocks: dict[int, list[NDArray[np.int32]]] = {}
        # 0 for a slot without keyframe.
        self._inverse_length = np.zeros(_FIRST_SLOTS, np.float32)
        self._slots = 0
        self._length = 0
        self._free_slots: list[int] = []
        # Slots removed before the current sweep, and during it.
        self._removed: list[int] = []
        self._removed_now: list[int] = []
        self._swept = 0

    def __len__(self) -> int:
        return self._length

    @property
    def nbytes(self) -> int:
        """Return the bytes of memory held."""
        lists = (self._start, self._count, self._capacity, self._frequency, self._inverse_length)
        return sum(array.nbytes for array in lists) + self._used * self._pool.itemsize

    def weights(self, words: NDArray[np.int32]) -> NDArray[np.float64]:
        """
        Return the inverse document frequency of words, 0 to 1: 1 for a word of one keyframe.

        :param words: (m,).
        :return: (m,) log((2 N + 2) / (2 max(f, 1) + 1)) / log((2 N + 2) / 3), f of N keyframes; 0
            for a word whose list is given up.
        """
        if not len(self):
            return np.ones(len(words))
        twice = 2.0 * len(self) + 2
        rare = np.log(twice / (2 * np.maximum(self._frequency[words], 1) + 1))
        listed = self._capacity[words] != _GIVEN_UP
        return np.asarray(listed * rare.clip(0) / np.log(twice / 3))

    def add(self, words: NDArray[np.int32]) -> int:
        """
        Add a keyframe and return its slot.

        :param words: (m,), its words, each once.
        """
        slot = self._new_slot()
        self._length += 1
        full = words[self._count[words] == self._capacity[words]]
        if len(full):
            self._make_room(full)
        listed = words[self._capacity[words] != _GIVEN_UP]
        self._pool[self._start[listed] + self._count[listed]] = slot
        self._count[listed] += 1
        self._frequency[words] += 1
        length = np.sqrt(np.square(self.weights(words)).sum())
        self._inverse_length[slot] = 1 / max(length, _LEAST_LENGTH)
        self._sweep()
        return slot

    def remove(self, slot: int) -> None:
        """Remove a keyframe; its entries are ignored until its lists are swept."""
        self._length -= 1
        self._inverse_length[slot] = 0
        self._removed_now.append(slot)

    def similarities(self, words: NDArray[np.int32]) -> NDArray[np.float32]:
        """
        Return the cosine of the weighted words of an image with those of each slot.

        :param words: (m,), of the image, each once.
        :return: (slots,), 0 to 1: sum over common words of weight^2 / (length * length); 0 for a
            slot without keyframe.
        """
        if not len(self) or not len(words):
            return np.zeros(self._slots, np.float32)
        squares = np.square(self.weights(words))
        length = max(float(np.sqrt(squares.sum())), _LEAST_LENGTH)
        listed = np.flatnonzero(self._count[words])
        order = listed[np.argsort(self._count[words[listed]], kind='stable')]
        total = np.cumsum(self._count[words[order]], dtype=np.int64)
        read = order[total <= self._entries_read]
        entries, counts = self._entries(words[read])
        sums = np.bincount(entries, np.repeat(squares[read], counts), self._slots)
        return (sums * (self._inverse_length[: self._slots] / length)).astype(np.float32)

    def _entries(self, words: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int16]]:
        """Return the lists of words one after the other, and the length of each."""
        counts = self._count[words]
        return self._pool[_ranges(self._start[words], counts)], counts

    def _new_slot(self) -> int:
        if self._free_slots:
            return self._free_slots.pop()
        if self._slots == len(self._inverse_length):
            empty = np.zeros_like(self._inverse_length)
            self._inverse_length = np.concatenate([self._inverse_length, empty])
        self._slots += 1
        return self._slots - 1

    def _make_room(self, words: NDArray[np.int32]) -> None:
        """Make room for one more entry in lists that are full."""
        self._drop_removed(words)
        words = words[self._count[words] == self._capacity[words]]
        # A list is moved once, also where its new capacity is that of others.
        capacities = self._capacity[words]
        for capacity in np.unique(capacities).tolist():
            moved = words[capacities == capacity]
            old, counts = self._start[moved], self._count[moved]
            larger = 0 if capacity >= _LONGEST else max(capacity * 3 // 2, _FIRST_CAPACITY)
            if larger:
                starts = self._allocate(len(moved), larger)
                self._pool[_ranges(starts, counts)] = self._pool[_ranges(old, counts)]
                self._start[moved], self._capacity[moved] = starts, larger
            else:
                self._count[moved], self._capacity[moved] = 0, _GIVEN_UP
            if capacity:
                self._free_blocks.setdefault(capacity, []).append(old)

    def _allocate(self, number: int, capacity: int) -> NDArray[np.int32]:
        """Return the starts (number,) of lists of a capacity, of the free ones first."""
        free = np.concatenate([*self._free_blocks.pop(capacity, []), np.empty(0, np.int32)])
        if len(free) > number:
            self._free_blocks[capacity] = [free[number:]]
        missing = max(number - len(free), 0)
        end = self._used + missing * capacity
        if end > len(self._pool):
            self._pool.resize(end + _POOL_STEP, refcheck=False)
        fresh = (self._used + capacity * np.arange(missing)).astype(np.int32)
        self._used = end
        return np.concatenate([free[:number], fresh])

    def _drop_removed(self, words: NDArray[np.int32]) -> None:
        """Drop the entries of removed keyframes from lists."""
        entries, counts = self._entries(words)
        kept = self._inverse_length[entries] > 0
        if kept.all():
            return
        owner = np.repeat(np.arange(len(words)), counts)[kept]
        left = np.bincount(owner, minlength=len(words)).astype(np.int16)
        self._pool[_ranges(self._start[words], left)] = entries[kept]
        self._count[words] = left
        self._frequency[words] -= counts - left

    def _sweep(self) -> None:
        """Drop removed keyframes from the next share of the words."""
        if not self._removed and not self._removed_now:
            return
        if self._swept == 0:
            self._removed, self._removed_now = self._removed_now, []
        share = -(-len(self._start) // _SWEEPS)
        last = min(self._swept + share, len(self._start))
        self._drop_removed(np.arange(self._swept, last, dtype=np.int32))
        self._swept = last % len(self._start)
        if self._swept == 0:
            self._free_slots += self._removed
            self._removed = []


def _ranges(starts: NDArray[np.int32], counts: NDArray[np.int16]) -> NDArray[np.int64]:
    """Return start, start + 1, ... of each range, one range after the other."""
    ends = np.cumsum(counts, dtype=np.int64)
    total = int(ends[-1]) if len(ends) else 0
    return np.arange(total) + np.repeat(starts - (ends - counts), counts)
