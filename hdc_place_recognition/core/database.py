# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The places seen so far, in memory."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from hdc_place_recognition.core.hdc import Hypervector
from hdc_place_recognition.core.landmarks import Landmarks
import numpy as np
from numpy.typing import NDArray

_CHUNK_ROWS = 64
# Squared lengths below this are rounding errors of centring, not directions.
_NOTHING = 1e-9


@dataclass(frozen=True)
class _Chunk:
    """Room for rows that is never moved: growing costs the same however many there are."""

    rows: NDArray[np.float32]
    squared_length: NDArray[np.float64]
    dot_sums: NDArray[np.float64]


@dataclass(frozen=True)
class Answer:
    """
    How similar the rows are to a query.

    :param similarities: (n,) float32, -1 to 1, each under the best displacement.
    :param displacements: (n,) intp, which one that is.
    """

    similarities: NDArray[np.float32]
    displacements: NDArray[np.intp]


@dataclass
class Database:
    """
    Descriptors of earlier images, compared by the centred cosine under several displacements.

    Centring (Sec. 3.1.4) subtracts from a query the mean of all queries seen so far under the
    same displacement, from a row that under none: causal, nothing from the future. The rows stay
    as they are: with means m of queries and mu of rows, (q - m)(x - mu) = qx - q mu - m x + m mu,
    and the products of rows with sums of queries grow by the products with each new query.

    :param dimensions: d.
    :param displacements: s, how many forms a query has; the middle one is stored.
    :param center: whether to subtract the means.
    :param extractor: identity of the local features; only equal ones can be compared.
    """

    dimensions: int
    displacements: int
    center: bool
    extractor: str
    stamps_ns: list[int] = field(default_factory=list)
    landmarks: list[Landmarks | None] = field(default_factory=list)
    _clock_ns: list[int] = field(default_factory=list)
    _chunks: list[_Chunk] = field(default_factory=list)
    _seen: int = 0

    def __post_init__(self) -> None:
        self._middle = self.displacements // 2
        self._sums = np.zeros((self.displacements, self.dimensions))
        self._asked: tuple[Hypervector, NDArray[Any]] | None = None

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def nbytes(self) -> int:
        """Bytes of memory held by the rows and their landmarks."""
        rows = sum(
            chunk.rows.nbytes + chunk.squared_length.nbytes + chunk.dot_sums.nbytes
            for chunk in self._chunks
        )
        return rows + sum(landmarks.nbytes for landmarks in self.landmarks if landmarks)

    def older_than(self, clock_ns: int, recent_rows: int) -> int:
        """
        Return how many rows may be candidates: the first ones, in the order of adding.

        :param clock_ns: rows of this clock time or before.
        :param recent_rows: but not these last ones of all.
        """
        return max(min(bisect_right(self._clock_ns, clock_ns), len(self) - recent_rows), 0)

    def see(self, query: Hypervector) -> None:
        """
        Take an image into the means, whether it will be stored or not.

        :param query: (s, d) float32.
        """
        if not self.center:
            return
        for chunk, rows, numbers in self._filled():
            chunk.dot_sums[rows] += self._products(query)[numbers]
        self._sums += query
        self._seen += 1

    def ask(self, query: Hypervector, count: int | None = None) -> Answer:
        """
        Return the centred cosine to the first rows; 0 where there is no direction to compare.

        :param query: (s, d) float32.
        :param count: rows to compare, all by default.
        """
        if not self.stamps_ns:
            return Answer(np.empty(0, np.float32), np.empty(0, np.intp))
        means = self._sums / max(self._seen, 1)
        mean = means[self._middle]
        dot_means = self._gather(lambda chunk, rows: chunk.dot_sums[rows])[:count]
        dot_means = dot_means / max(self._seen, 1)
        row_square = self._gather(lambda chunk, rows: chunk.squared_length[rows])[:count]
        row_square = row_square - 2 * dot_means[:, self._middle] + mean @ mean
        query_square = np.square(query - means).sum(axis=1)
        above = self._products(query)[:count] - query @ mean - dot_means + means @ mean
        below = row_square[:, None] * query_square
        cosine = np.divide(
            above,
            np.sqrt(np.maximum(below, _NOTHING)),
            out=np.zeros_like(below),
            where=below > _NOTHING,
        )
        best = cosine.argmax(axis=1)
        similarities = np.take_along_axis(cosine, best[:, None], axis=1)[:, 0]
        return Answer(np.clip(similarities, -1, 1).astype(np.float32), best)

    def add(
        self, stamp_ns: int, clock_ns: int, query: Hypervector, landmarks: Landmarks | None = None
    ) -> int:
        """
        Store the middle form of an image and return its row.

        :param stamp_ns: the image's header stamp.
        :param clock_ns: the same on a clock that never goes back.
        :param query: (s, d) float32.
        :param landmarks: to verify it by.
        """
        row, descriptor = len(self), query[self._middle]
        if row == len(self._chunks) * _CHUNK_ROWS:
            self._chunks.append(self._new_chunk())
        chunk, place = self._chunks[-1], row % _CHUNK_ROWS
        chunk.rows[place] = descriptor
        chunk.squared_length[place] = float(descriptor @ descriptor)
        chunk.dot_sums[place] = self._sums @ descriptor
        self.stamps_ns.append(stamp_ns)
        self.landmarks.append(landmarks)
        self._clock_ns.append(clock_ns)
        self._asked = None
        return row

    def _new_chunk(self) -> _Chunk:
        return _Chunk(
            np.empty((_CHUNK_ROWS, self.dimensions), np.float32),
            np.empty(_CHUNK_ROWS),
            np.empty((_CHUNK_ROWS, self.displacements)),
        )

    def _products(self, query: Hypervector) -> NDArray[np.float32]:
        """Return the products of all rows with a query, (n, s): one pass, also if asked again."""
        if self._asked is None or self._asked[0] is not query:
            products = self._gather(lambda chunk, rows: chunk.rows[rows] @ query.T)
            self._asked = query, products
        return self._asked[1]

    def _gather(self, get: Callable[[_Chunk, slice], NDArray[Any]]) -> NDArray[Any]:
        """Return what `get` gives for the filled rows of every chunk, as one array."""
        return np.concatenate([get(chunk, rows) for chunk, rows, _ in self._filled()])

    def _filled(self) -> Iterator[tuple[_Chunk, slice, slice]]:
        """Yield each chunk with its filled rows and their numbers in the database."""
        for index, chunk in enumerate(self._chunks):
            start = index * _CHUNK_ROWS
            filled = min(len(self) - start, _CHUNK_ROWS)
            yield chunk, slice(0, filled), slice(start, start + filled)
