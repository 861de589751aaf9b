# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Room for hypervectors, which grows without moving any."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hdc_place_recognition.database import sign_index
from hdc_place_recognition.database.sign_index import SignTable
from hdc_place_recognition.database.storage import Memory, Room
from hdc_place_recognition.hdc import algebra
import numpy as np
from numpy.typing import NDArray

# With so few probes BLAS is faster one at a time, over rows that stay in the cache.
_FEW_PROBES, _CACHED_ROWS = 3, 32
# Enough to be worth a call.
_CHUNK_ROWS = 256
# Vectors looked at before the room may let go of them.
_RESTLESS = 128


@dataclass(frozen=True)
class _Chunk:
    """Some places; memory that was never written is not taken from the system."""

    vectors: NDArray[Any]
    squares: NDArray[np.float64]


class Rows:
    """
    Hypervectors in numbered places, with their signs and squared lengths.

    :param dimensions: d.
    :param kind: float32, or float16 for half the memory.
    :param room: where they are kept, in memory by default.
    """

    def __init__(self, dimensions: int, kind: str = 'float32', room: Room | None = None) -> None:
        self.dimensions = dimensions
        self.signs = SignTable(sign_index.words(dimensions))
        self._kind, self._room = np.dtype(kind), room or Memory()
        self._chunks: list[_Chunk] = []
        self._count = 0
        self._looked_at = 0

    def __len__(self) -> int:
        """Return how many places are filled: the first ones."""
        return self._count

    @property
    def row_nbytes(self) -> int:
        """Bytes of memory held by each row."""
        vector = self._kind.itemsize * self.dimensions if self._room.resident else 0
        return vector + 8 * sign_index.words(self.dimensions) + 8

    def add(self, vector: algebra.Hypervector, threshold: algebra.Hypervector) -> None:
        """
        Store a vector in the next place.

        :param vector: (d,) float32.
        :param threshold: (d,) float32, what its signs are taken against.
        :raises PlaceRecognitionError: there is no room for it; nothing is changed.
        """
        if self._count == len(self._chunks) * _CHUNK_ROWS:
            self._chunks.append(self._new_chunk())
        chunk, inside = self._at(self._count)
        chunk.vectors[inside] = vector
        stored = chunk.vectors[inside].astype(np.float32, copy=False)
        chunk.squares[inside] = float(stored @ stored)
        self._count += 1
        self.sign(self._count - 1, threshold)

    def sign(self, place: int, threshold: algebra.Hypervector, count: int = 1) -> None:
        """Take the signs of a place, and of some after it in its chunk, against a threshold."""
        chunk, inside = self._at(place)
        some = slice(inside, inside + min(count, self._count - place))
        vectors = chunk.vectors[some].astype(np.float32, copy=False)
        self.signs.put(place, sign_index.signs(vectors, threshold))
        self._look_at(count)

    def remove(self, place: int) -> None:
        """Forget what is in a place; what is in the last one moves there."""
        last = self._count - 1
        if place != last:
            (target, to), (source, inside) = self._at(place), self._at(last)
            target.vectors[to] = source.vectors[inside]
            target.squares[to] = source.squares[inside]
            self.signs.put(place, self.signs.get(last)[None])
        self._count = last
        self.signs.keep(last)
        # One empty chunk stays: the next vector may need it again.
        while len(self._chunks) > last // _CHUNK_ROWS + 2:
            self._room.give_back(self._chunks.pop().vectors)

    def vector(self, place: int) -> algebra.Hypervector:
        """Return (d,) float32, a view where it is kept as that."""
        self._look_at(1)
        chunk, inside = self._at(place)
        return chunk.vectors[inside].astype(np.float32, copy=False)

    def squares(self, count: int) -> NDArray[np.float64]:
        """Return (count,) float64, the squared lengths of the first places."""
        return np.concatenate([chunk.squares[:filled] for chunk, filled in self._filled(count)])

    def products(
        self, probes: algebra.Hypervector, count: int, first: int = 0
    ) -> NDArray[np.float32]:
        """Return products of places from `first` to `count` with probes (p, d): float32."""
        found = np.empty((count - first, len(probes)), np.float32)
        place = first
        while place < count:
            chunk, inside = self._at(place)
            vectors = chunk.vectors[slice(inside, inside + count - place)]
            done = slice(place - first, place - first + len(vectors))
            found[done] = _products(vectors, probes)
            self._look_at(len(vectors))
            place += len(vectors)
        return found

    def gather(self, places: NDArray[np.intp]) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Return copies of some vectors (k, d) float32 and their squared lengths (k,)."""
        vectors = np.empty((len(places), self.dimensions), np.float32)
        squares = np.empty(len(places))
        for index, place in enumerate(places.tolist()):
            chunk, inside = self._at(place)
            vectors[index], squares[index] = chunk.vectors[inside], chunk.squares[inside]
            self._look_at(1)
        return vectors, squares

    def _look_at(self, vectors: int) -> None:
        self._looked_at += vectors
        if self._looked_at >= _RESTLESS:
            self._looked_at = 0
            self._room.rest()

    def _at(self, place: int) -> tuple[_Chunk, int]:
        index, inside = divmod(place, _CHUNK_ROWS)
        return self._chunks[index], inside

    def _new_chunk(self) -> _Chunk:
        vectors = self._room.take(_CHUNK_ROWS, self.dimensions, self._kind)
        return _Chunk(vectors, np.empty(_CHUNK_ROWS))

    def _filled(self, count: int) -> Iterator[tuple[_Chunk, int]]:
        """Yield the chunks of the first places with the number of these that each has."""
        for start in range(0, count, _CHUNK_ROWS):
            yield self._chunks[start // _CHUNK_ROWS], min(count - start, _CHUNK_ROWS)


def _products(vectors: NDArray[Any], probes: algebra.Hypervector) -> NDArray[np.float32]:
    vectors = vectors.astype(np.float32, copy=False)
    if len(probes) > _FEW_PROBES:
        return vectors @ probes.T
    products = np.empty((len(vectors), len(probes)), np.float32)
    rows = _CACHED_ROWS if len(probes) > 1 else len(vectors)
    for start in range(0, len(vectors), rows):
        block = slice(start, start + rows)
        for index, probe in enumerate(probes):
            products[block, index] = vectors[block] @ probe
    return products


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
