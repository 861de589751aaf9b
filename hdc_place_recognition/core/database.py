# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The places seen so far, in memory."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from hdc_place_recognition.core.hdc import Hypervector
import numpy as np
from numpy.typing import NDArray

_CHUNK_ROWS = 1024
# Squared lengths below this are rounding errors of centring, not directions.
_NOTHING = 1e-9


@dataclass(frozen=True)
class _Chunk:
    """Room for rows that is never moved: growing costs the same however many there are."""

    rows: NDArray[np.float32]
    squared_length: NDArray[np.float64]
    dot_sum: NDArray[np.float64]


@dataclass
class Database:
    """
    Descriptors of the images seen so far, compared by the centred cosine.

    Centring (Sec. 3.1.4) subtracts the mean of all rows from the query and from each row. The
    rows stay as they are: with the mean mu, (q - mu)(x - mu) = qx - q mu - x mu + mu mu, and the
    products of the rows with the sum of rows are brought up to date from the products with each
    new row. The mean is causal, it knows only what was added before.

    :param dimensions: d.
    :param center: whether to subtract the mean.
    :param extractor: identity of the local features; only equal ones can be compared.
    """

    dimensions: int
    center: bool
    extractor: str
    stamps_ns: list[int] = field(default_factory=list)
    _clock_ns: list[int] = field(default_factory=list)
    _chunks: list[_Chunk] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._sum = np.zeros(self.dimensions)
        self._asked: tuple[Hypervector, NDArray[Any]] | None = None

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def nbytes(self) -> int:
        """Bytes of memory held by the rows."""
        return sum(
            chunk.rows.nbytes + chunk.squared_length.nbytes + chunk.dot_sum.nbytes
            for chunk in self._chunks
        )

    def older_than(self, clock_ns: int, recent_rows: int) -> int:
        """
        Return how many rows may be candidates: the first ones, in the order of adding.

        :param clock_ns: rows of this clock time or before.
        :param recent_rows: but not these last ones of all.
        """
        return max(min(bisect_right(self._clock_ns, clock_ns), len(self) - recent_rows), 0)

    def similarities(
        self, descriptor: Hypervector, count: int | None = None
    ) -> NDArray[np.float32]:
        """
        Return the centred cosine to the first rows; 0 where there is no direction to compare.

        :param descriptor: q, (d,) float32.
        :param count: rows to compare, all by default.
        :return: (count,) float32, -1 to 1.
        """
        mean = self._sum / max(len(self), 1) if self.center else np.zeros(self.dimensions)
        square, query = float(mean @ mean), descriptor.astype(np.float64)
        query_mean, row_mean = float(query @ mean), self._row_means()[:count]
        above = self._products(descriptor)[:count] - query_mean - row_mean + square
        row_square = self._gather(lambda chunk, rows: chunk.squared_length[rows])[:count]
        below = (float(query @ query) - 2 * query_mean + square) * (
            row_square - 2 * row_mean + square
        )
        cosine = np.divide(
            above,
            np.sqrt(np.maximum(below, _NOTHING)),
            out=np.zeros(len(above)),
            where=below > _NOTHING,
        )
        return np.clip(cosine, -1, 1).astype(np.float32)

    def add(self, stamp_ns: int, clock_ns: int, descriptor: Hypervector) -> int:
        """
        Store a row and return its number.

        :param stamp_ns: the image's header stamp.
        :param clock_ns: the same on a clock that never goes back.
        :param descriptor: (d,) float32.
        """
        row, products = len(self), self._products(descriptor)
        if row == len(self._chunks) * _CHUNK_ROWS:
            self._chunks.append(
                _Chunk(
                    np.empty((_CHUNK_ROWS, self.dimensions), np.float32),
                    np.empty(_CHUNK_ROWS),
                    np.empty(_CHUNK_ROWS),
                )
            )
        for chunk, rows, numbers in self._filled():
            chunk.dot_sum[rows] += products[numbers]
        chunk, place = self._chunks[-1], row % _CHUNK_ROWS
        self._sum += descriptor
        chunk.rows[place] = descriptor
        chunk.squared_length[place] = float(descriptor @ descriptor)
        chunk.dot_sum[place] = float(self._sum @ descriptor)
        self.stamps_ns.append(stamp_ns)
        self._clock_ns.append(clock_ns)
        self._asked = None
        return row

    def _products(self, descriptor: Hypervector) -> NDArray[np.float32]:
        """Return the dot products with all rows: one pass, also if asked again to add."""
        if self._asked is None or self._asked[0] is not descriptor:
            self._asked = (
                descriptor,
                self._gather(lambda chunk, rows: chunk.rows[rows] @ descriptor, np.float32),
            )
        return self._asked[1]

    def _row_means(self) -> NDArray[np.float64]:
        """Return the products of all rows with the mean, (n,)."""
        if not self.center:
            return np.zeros(len(self))
        return self._gather(lambda chunk, rows: chunk.dot_sum[rows]) / max(len(self), 1)

    def _gather(
        self, get: Callable[[_Chunk, slice], NDArray[Any]], dtype: type = np.float64
    ) -> NDArray[Any]:
        """Return what `get` gives for the filled rows of every chunk, as one array."""
        parts = [get(chunk, rows) for chunk, rows, _ in self._filled()]
        return np.concatenate(parts) if parts else np.empty(0, dtype)

    def _filled(self) -> Iterator[tuple[_Chunk, slice, slice]]:
        """Yield each chunk with its filled rows and their numbers in the database."""
        for index, chunk in enumerate(self._chunks):
            start = index * _CHUNK_ROWS
            filled = min(len(self) - start, _CHUNK_ROWS)
            yield chunk, slice(0, filled), slice(start, start + filled)


def best_rows(similarities: NDArray[np.float32], count: int) -> NDArray[np.intp]:
    """
    Return the rows of the highest similarities, best first; of equals the older first.

    :param similarities: (n,).
    :return: (min(count, n),) intp.
    """
    if len(similarities) > count:
        least = np.partition(similarities, -count)[-count]
        rows = np.flatnonzero(similarities >= least)
    else:
        rows = np.arange(len(similarities))
    return rows[np.argsort(-similarities[rows], kind='stable')][:count]
