# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Room for hypervectors, which grows without moving any."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hdc_place_recognition.core import hdc, signs
import numpy as np
from numpy.typing import NDArray

# With so few probes BLAS is faster one at a time, over rows that stay in the cache.
_FEW_PROBES, _CACHED_ROWS = 3, 32
# Few enough for the differing signs of a chunk to stay in the cache, enough to be worth a call.
_CHUNK_ROWS = 256


@dataclass(frozen=True)
class _Chunk:
    """Some places; memory that was never written is not taken from the system."""

    vectors: NDArray[np.float32]
    squares: NDArray[np.float64]
    signs: signs.Signs


class Rows:
    """
    Hypervectors in numbered places, with their signs and squared lengths.

    :param dimensions: d.
    """

    def __init__(self, dimensions: int) -> None:
        self.dimensions = dimensions
        self._chunks: list[_Chunk] = []
        self._count = 0
        self._free: list[int] = []

    def __len__(self) -> int:
        """Return how many places were ever filled."""
        return self._count

    @property
    def nbytes(self) -> int:
        """Bytes of memory held."""
        return self._count * (4 * self.dimensions + 8 * signs.words(self.dimensions) + 8)

    def add(self, vector: hdc.Hypervector, threshold: hdc.Hypervector) -> int:
        """
        Store a vector and return its place, one that was freed if there is any.

        :param vector: (d,) float32.
        :param threshold: (d,) float32, what its signs are taken against.
        """
        if self._free:
            place = self._free.pop()
        else:
            place = self._count
            if place == len(self._chunks) * _CHUNK_ROWS:
                self._chunks.append(self._new_chunk())
            self._count += 1
        chunk, inside = self._at(place)
        chunk.vectors[inside] = vector
        chunk.squares[inside] = float(vector @ vector)
        self.sign(place, threshold)
        return place

    def sign(self, place: int, threshold: hdc.Hypervector) -> None:
        """Take the signs of a place against another threshold."""
        chunk, inside = self._at(place)
        chunk.signs[inside] = signs.signs(chunk.vectors[inside][None], threshold)[0]

    def free(self, place: int) -> None:
        """Let a place be filled with another vector."""
        self._free.append(place)

    def vector(self, place: int) -> hdc.Hypervector:
        """Return (d,) float32, a view."""
        chunk, inside = self._at(place)
        return chunk.vectors[inside]

    def squares(self, count: int) -> NDArray[np.float64]:
        """Return (count,) float64, the squared lengths of the first places."""
        return np.concatenate([chunk.squares[:filled] for chunk, filled in self._filled(count)])

    def products(self, probes: hdc.Hypervector, count: int) -> NDArray[np.float32]:
        """Return the products of the first places with probes (p, d): (count, p) float32."""
        return np.concatenate(
            [_products(chunk.vectors[:filled], probes) for chunk, filled in self._filled(count)]
        )

    def distances(self, queries: signs.Signs, count: int) -> NDArray[np.uint32]:
        """Return how many signs of the first places differ from the nearest query (b, w)."""
        return np.concatenate(
            [
                signs.distances(chunk.signs[:filled], queries)
                for chunk, filled in self._filled(count)
            ]
        )

    def gather(self, places: NDArray[np.intp]) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Return copies of some vectors (k, d) and their squared lengths (k,)."""
        vectors = np.empty((len(places), self.dimensions), np.float32)
        squares = np.empty(len(places))
        for index, place in enumerate(places.tolist()):
            chunk, inside = self._at(place)
            vectors[index], squares[index] = chunk.vectors[inside], chunk.squares[inside]
        return vectors, squares

    def _at(self, place: int) -> tuple[_Chunk, int]:
        index, inside = divmod(place, _CHUNK_ROWS)
        return self._chunks[index], inside

    def _new_chunk(self) -> _Chunk:
        return _Chunk(
            np.empty((_CHUNK_ROWS, self.dimensions), np.float32),
            np.empty(_CHUNK_ROWS),
            np.empty((_CHUNK_ROWS, signs.words(self.dimensions)), np.uint64),
        )

    def _filled(self, count: int) -> Iterator[tuple[_Chunk, int]]:
        """Yield the chunks of the first places with the number of these that each has."""
        for start in range(0, count, _CHUNK_ROWS):
            yield self._chunks[start // _CHUNK_ROWS], min(count - start, _CHUNK_ROWS)


def _products(vectors: NDArray[np.float32], probes: hdc.Hypervector) -> NDArray[np.float32]:
    if len(probes) > _FEW_PROBES:
        return vectors @ probes.T
    products = np.empty((len(vectors), len(probes)), np.float32)
    for start in range(0, len(vectors), _CACHED_ROWS):
        block = slice(start, start + _CACHED_ROWS)
        for index, probe in enumerate(probes):
            products[block, index] = vectors[block] @ probe
    return products
