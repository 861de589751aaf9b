# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Hypervectors in numbered slots, growing without moving any.

Slots have no gaps: when a vector is removed, the last one moves to its slot. :class:`SlotOrder`
remembers in which slot the vector of each row is, in the order of adding.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hdc_place_recognition.database.sign_index import SignIndex, signs, word_count
from hdc_place_recognition.database.storage import RamStorage, VectorStorage
from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np
from numpy.typing import NDArray

# For so few probes BLAS is faster one at a time.
_FEW_PROBES = 3
# Enough vectors to outweigh the cost of a call, and few enough to stay in the cache for the next
# probe.
_CHUNK_SLOTS = 256
# Number of vectors read before the pages of a file are dropped from memory.
_READS_BEFORE_DROP = 128


@dataclass(frozen=True)
class _Chunk:
    """Some slots; the system assigns memory when it is first written."""

    vectors: NDArray[Any]
    squares: NDArray[np.float64]


class VectorStore:
    """
    Hypervectors in numbered slots, with their signs and squared lengths.

    :param dimensions: d.
    :param dtype: 'float32', or 'float16' for half the memory.
    :param storage: where they are kept, RAM by default.
    """

    def __init__(
        self, dimensions: int, dtype: str = 'float32', storage: VectorStorage | None = None
    ) -> None:
        self.dimensions = dimensions
        self.signs = SignIndex(word_count(dimensions))
        self._dtype, self._storage = np.dtype(dtype), storage or RamStorage()
        self._chunks: list[_Chunk] = []
        self._count = 0
        self._reads = 0

    def __len__(self) -> int:
        """Return how many slots are filled: the first ones."""
        return self._count

    @property
    def slot_nbytes(self) -> int:
        """Return the bytes of memory of a slot."""
        vector = self._dtype.itemsize * self.dimensions if self._storage.resident else 0
        return vector + 8 * word_count(self.dimensions) + 8

    def add(self, vector: Hypervector, threshold: Hypervector) -> None:
        """
        Store a vector in the next slot.

        :param vector: (d,) float32.
        :param threshold: (d,) float32, against which its signs are taken.
        :raises PlaceRecognitionError: there is no storage for it; nothing is changed.
        """
        if self._count == len(self._chunks) * _CHUNK_SLOTS:
            self._chunks.append(self._new_chunk())
        chunk, inside = self._at(self._count)
        chunk.vectors[inside] = vector
        stored = chunk.vectors[inside].astype(np.float32, copy=False)
        chunk.squares[inside] = float(stored @ stored)
        self._count += 1
        self.update_signs(self._count - 1, threshold)

    def update_signs(self, slot: int, threshold: Hypervector, count: int = 1) -> None:
        """Take the signs of a slot, and of following ones of its chunk, against a threshold."""
        chunk, inside = self._at(slot)
        target = slice(inside, inside + min(count, self._count - slot))
        vectors = chunk.vectors[target].astype(np.float32, copy=False)
        self.signs.put(slot, signs(vectors, threshold))
        self._note_reads(count)

    def remove(self, slot: int) -> None:
        """Remove the vector of a slot; that of the last slot moves there."""
        last = self._count - 1
        if slot != last:
            (target, to), (source, inside) = self._at(slot), self._at(last)
            target.vectors[to] = source.vectors[inside]
            target.squares[to] = source.squares[inside]
            self.signs.put(slot, self.signs.get(last)[None])
        self._count = last
        self.signs.truncate(last)
        # One empty chunk stays: the next vector may need it again.
        while len(self._chunks) > last // _CHUNK_SLOTS + 2:
            self._storage.release(self._chunks.pop().vectors)

    def vector(self, slot: int) -> Hypervector:
        """Return (d,) float32, a view if it is stored as float32."""
        self._note_reads(1)
        chunk, inside = self._at(slot)
        return chunk.vectors[inside].astype(np.float32, copy=False)

    def squares(self, count: int) -> NDArray[np.float64]:
        """Return (count,) float64, the squared lengths of the first slots."""
        return np.concatenate([chunk.squares[:filled] for chunk, filled in self._filled(count)])

    def products(self, probes: Hypervector, count: int) -> NDArray[np.float32]:
        """Multiply the vectors of the first slots with probes (p, d): (count, p) float32."""
        found = np.empty((count, len(probes)), np.float32)
        for index, (chunk, filled) in enumerate(self._filled(count)):
            target = slice(index * _CHUNK_SLOTS, index * _CHUNK_SLOTS + filled)
            found[target] = _products(chunk.vectors[:filled], probes)
            self._note_reads(filled)
        return found

    def gather(self, slots: NDArray[np.intp]) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Return copies of some vectors (k, d) float32 and their squared lengths (k,)."""
        vectors = np.empty((len(slots), self.dimensions), np.float32)
        squares = np.empty(len(slots))
        for index, slot in enumerate(slots.tolist()):
            chunk, inside = self._at(slot)
            vectors[index], squares[index] = chunk.vectors[inside], chunk.squares[inside]
            self._note_reads(1)
        return vectors, squares

    def _note_reads(self, vectors: int) -> None:
        self._reads += vectors
        if self._reads >= _READS_BEFORE_DROP:
            self._reads = 0
            self._storage.drop_pages()

    def _at(self, slot: int) -> tuple[_Chunk, int]:
        index, inside = divmod(slot, _CHUNK_SLOTS)
        return self._chunks[index], inside

    def _new_chunk(self) -> _Chunk:
        vectors = self._storage.allocate(_CHUNK_SLOTS, self.dimensions, self._dtype)
        return _Chunk(vectors, np.empty(_CHUNK_SLOTS))

    def _filled(self, count: int) -> Iterator[tuple[_Chunk, int]]:
        """Yield the chunks of the first slots with the number of these in each."""
        for start in range(0, count, _CHUNK_SLOTS):
            yield self._chunks[start // _CHUNK_SLOTS], min(count - start, _CHUNK_SLOTS)


def _products(vectors: NDArray[Any], probes: Hypervector) -> NDArray[np.float32]:
    vectors = vectors.astype(np.float32, copy=False)
    if len(probes) > _FEW_PROBES:
        return vectors @ probes.T
    return np.stack([vectors @ probe for probe in probes], axis=1)


class SlotOrder:
    """The slot of each row; rows are in the order of adding, and have no gaps either."""

    def __init__(self) -> None:
        self._count = 0
        # None as long as every row is in the slot of its own number.
        self._slots: array[int] | None = None

    @property
    def row_nbytes(self) -> int:
        """Return the bytes of memory of a row."""
        return 0 if self._slots is None else self._slots.itemsize

    def append(self) -> None:
        """Note that a new row is in the next slot."""
        if self._slots is not None:
            self._slots.append(self._count)
        self._count += 1

    def slot(self, row: int) -> int:
        """Return the slot of a row."""
        return row if self._slots is None else self._slots[row]

    def remove(self, row: int) -> None:
        """Note that a row was removed, and that the last slot moved to its slot."""
        last, slot = self._count - 1, self.slot(row)
        if self._slots is None and row != last:
            self._slots = array('q', range(self._count))
        if self._slots is not None:
            self._slots[int(np.flatnonzero(np.array(self._slots) == last)[0])] = slot
            del self._slots[row]
        self._count = last

    def slots_to_read(self, rows: int) -> int:
        """Return how many slots, from the first, hold the first rows."""
        return rows if self._slots is None else self._count

    def slots(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the slots of some rows."""
        return rows if self._slots is None else np.array(self._slots, np.intp)[rows]

    def in_order(self, values: NDArray[Any], rows: int) -> NDArray[Any]:
        """Return the values of the first rows, in their order, from (..., slots) values."""
        if self._slots is None:
            return values[..., :rows]
        return values[..., np.array(self._slots[:rows], np.intp)]
