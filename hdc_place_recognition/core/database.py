# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The places seen so far, in memory."""

from __future__ import annotations

from array import array
from bisect import bisect_right

from hdc_place_recognition.core.hdc import Hypervector
from hdc_place_recognition.core.landmarks import Landmarks
from hdc_place_recognition.core.rows import Rows
from hdc_place_recognition.core.search import (
    Answer,
    Question,
    search_all,
    search_in_two_stages,
)
import numpy as np
from numpy.typing import NDArray

# Rows from which two stages are worth it. Under 25 displacements on one core the exact search
# takes 2.9 us a row, the other 0.25 us a row and 3 ms: the same at 1000 rows, half at 2000.
TWO_STAGES_FROM = 2048
# With each new row the signs of this many others are taken anew, against the mean of today: no
# row's mean is then of less than half the images.
_REFRESHED = 2


class Database:
    """
    Descriptors of earlier images, compared by the centred cosine under several displacements.

    Centring (Sec. 3.1.4) subtracts from a query the mean of all queries seen so far under the
    same displacement, from a row that under none: causal, nothing from the future. The rows stay
    as they are.

    :param dimensions: d.
    :param displacements: s, how many forms a query has; the middle one is stored.
    :param center: whether to subtract the means.
    :param extractor: identity of the local features; only equal ones can be compared.
    :param groups: indices of forms that are near to each other, for the first of two stages;
        all in one by default.
    """

    def __init__(
        self,
        dimensions: int,
        displacements: int,
        center: bool,
        extractor: str,
        groups: tuple[tuple[int, ...], ...] = (),
    ) -> None:
        self.center, self.extractor = center, extractor
        self.stamps_ns: list[int] = []
        self.landmarks: list[Landmarks | None] = []
        self._clock_ns: list[int] = []
        self._places = array('q')
        self._rows = Rows(dimensions)
        self._middle = displacements // 2
        self._groups = groups or (tuple(range(displacements)),)
        self._sums = np.zeros((displacements, dimensions))
        self._seen = 0
        self._refreshed = 0

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def nbytes(self) -> int:
        """Bytes of memory held by the rows and their landmarks."""
        return self._rows.nbytes + sum(each.nbytes for each in self.landmarks if each)

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
        if self.center:
            self._sums += query
            self._seen += 1

    def ask(self, query: Hypervector, count: int | None = None, *, exact: bool = False) -> Answer:
        """
        Return the centred cosine to the first rows; 0 where there is no direction to compare.

        :param query: (s, d) float32.
        :param count: rows to compare, all by default.
        :param exact: compare all of them however many they are.
        """
        places = np.array(self._places[:count], np.intp)
        if not len(places):
            nothing = np.empty(0, np.float32)
            return Answer(nothing, np.empty(0, np.intp), nothing)
        question = Question(query, self._sums / max(self._seen, 1))
        if exact or len(places) < TWO_STAGES_FROM:
            return search_all(self._rows, places, question)
        return search_in_two_stages(self._rows, places, question, self._groups)

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
        mean = self._mean()
        self._places.append(self._rows.add(query[self._middle], mean))
        self.stamps_ns.append(stamp_ns)
        self.landmarks.append(landmarks)
        self._clock_ns.append(clock_ns)
        self._refresh(mean)
        return len(self) - 1

    def _mean(self) -> NDArray[np.float32]:
        """Return (d,), the mean of the middle forms."""
        return (self._sums[self._middle] / max(self._seen, 1)).astype(np.float32)

    def _refresh(self, mean: NDArray[np.float32]) -> None:
        """Take the signs of the next rows in turn against the mean of today."""
        for _ in range(_REFRESHED):
            self._refreshed = (self._refreshed + 1) % len(self._rows)
            self._rows.sign(self._refreshed, mean)
