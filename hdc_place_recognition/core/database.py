# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The places seen so far, in memory."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from dataclasses import dataclass

from hdc_place_recognition.core.hdc import Hypervector
from hdc_place_recognition.core.landmarks import Landmarks
from hdc_place_recognition.core.redundancy import Redundancy
from hdc_place_recognition.core.rows import Rows
from hdc_place_recognition.core.search import Answer, Question, search_all, search_in_two_stages
import numpy as np
from numpy.typing import NDArray

# Rows from which two stages are worth it. On one core, exact against two stages, under 25
# displacements: 2.9 and 3.2 ms at 1000 rows, 6.5 and 3.8 at 2048, 12.1 and 4.9 at 4096; without
# any: 0.6 and 1.3, 1.5 and 1.6, 2.8 and 1.9 ms.
TWO_STAGES_FROM = 2048
# With each new row the signs of this many others are taken anew, against the mean of today: no
# row's mean is then of less than half the images.
_REFRESHED = 2


@dataclass(frozen=True)
class Forgotten:
    """An image that is no longer in the database: the row it had, and its number."""

    row: int
    keyframe_id: int


class Database:
    """
    Descriptors of earlier images, compared by the centred cosine under several displacements.

    Centring (Sec. 3.1.4) subtracts from a query the mean of all queries seen so far under the
    same displacement, from a row that under none: causal, nothing from the future. The rows stay
    as they are.

    Rows are in the order of adding. An image keeps its number, which is its row until images
    before it are forgotten.

    :param dimensions: d.
    :param displacements: s, how many forms a query has; the middle one is stored.
    :param center: whether to subtract the means.
    :param extractor: identity of the local features; only equal ones can be compared.
    :param groups: indices of forms that are near to each other, for the first of two stages;
        all in one by default.
    :param max_keyframes: of more images the most redundant one is forgotten; 0 for no limit.
    """

    def __init__(
        self,
        dimensions: int,
        displacements: int,
        center: bool,
        extractor: str,
        groups: tuple[tuple[int, ...], ...] = (),
        max_keyframes: int = 0,
    ) -> None:
        self.center, self.extractor = center, extractor
        self.stamps_ns: list[int] = []
        self.ids: list[int] = []
        self.landmarks: list[Landmarks | None] = []
        self._clock_ns: list[int] = []
        self._places = array('q')
        self._rows = Rows(dimensions)
        self._middle = displacements // 2
        self._groups = groups or (tuple(range(displacements)),)
        self._sums = np.zeros((displacements, dimensions))
        self._seen = 0
        self._refreshed = 0
        self._max_keyframes = max_keyframes
        self._redundancy = Redundancy(self._vector)
        self._added = 0
        self._likest: tuple[Hypervector | None, int | None] = None, None
        self.last_forgotten: Forgotten | None = None

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def nbytes(self) -> int:
        """Bytes of memory held by the rows and their landmarks."""
        return self._rows.nbytes + sum(each.nbytes for each in self.landmarks if each)

    @property
    def forgotten(self) -> int:
        """Return how many images were forgotten, also those that were not stored at all."""
        return self._added - len(self)

    def row(self, keyframe_id: int) -> int | None:
        """Return the row of an image, None if it was forgotten."""
        row = bisect_left(self.ids, keyframe_id)
        return row if row < len(self) and self.ids[row] == keyframe_id else None

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
            answer = search_all(self._rows, places, question)
        else:
            answer = search_in_two_stages(self._rows, places, question, self._groups)
        self._likest = query, self.ids[int(answer.similarities.argmax())]
        return answer

    def add(
        self, stamp_ns: int, clock_ns: int, query: Hypervector, landmarks: Landmarks | None = None
    ) -> int | None:
        """
        Store the middle form of an image and return its number.

        In a full database the most redundant image is forgotten for it; where each shows a place
        of its own, or the new one is that image, the new one is not stored.

        :param stamp_ns: the image's header stamp.
        :param clock_ns: the same on a clock that never goes back.
        :param query: (s, d) float32.
        :param landmarks: to verify it by.
        :return: None if it was not stored.
        """
        mean, number = self._mean(), self._added
        if self._max_keyframes:
            asked, twin = self._likest
            twin = twin if asked is query else None
            twin_row = None if twin is None else self.row(twin)
            self._redundancy.add(query[self._middle], twin, twin_row)
        self._places.append(self._rows.add(query[self._middle], mean))
        self.stamps_ns.append(stamp_ns)
        self.landmarks.append(landmarks)
        self._clock_ns.append(clock_ns)
        self.ids.append(number)
        self._added += 1
        self._refresh(mean)
        self.last_forgotten = None
        if 0 < self._max_keyframes < len(self):
            row = self._redundancy.most_redundant()
            self._forget(len(self) - 1 if row is None else row)
        return number if self.ids[-1] == number else None

    def _forget(self, row: int) -> None:
        self._redundancy.forget(row, self.ids[row])
        self._rows.free(self._places[row])
        self.last_forgotten = Forgotten(row, self.ids[row])
        for values in (self._places, self.ids, self.stamps_ns, self._clock_ns, self.landmarks):
            del values[row]

    def _vector(self, row: int) -> Hypervector:
        return self._rows.vector(self._places[row])

    def _mean(self) -> NDArray[np.float32]:
        """Return (d,), the mean of the middle forms."""
        return (self._sums[self._middle] / max(self._seen, 1)).astype(np.float32)

    def _refresh(self, mean: NDArray[np.float32]) -> None:
        """Take the signs of the next rows in turn against the mean of today."""
        for _ in range(_REFRESHED):
            self._refreshed = (self._refreshed + 1) % len(self._rows)
            self._rows.sign(self._refreshed, mean)
