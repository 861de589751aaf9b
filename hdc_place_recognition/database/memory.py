# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What is known of the images of a database besides their vectors."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from hdc_place_recognition.database.centering import MeanProducts, Means
from hdc_place_recognition.database.eviction import Forgotten, Limit, Redundancy
from hdc_place_recognition.database.search import (
    Answer,
    Question,
    search_all,
    search_in_two_stages,
)
from hdc_place_recognition.database.vector_store import Order, Rows
from hdc_place_recognition.features.compact import Landmarks
from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np

# Two stamps, a number, and a pointer to landmarks.
_BYTES = 4 * 8


class Entries:
    """The numbers, stamps and landmarks of images, in the order of adding."""

    def __init__(self) -> None:
        self.ids = array('q')
        self.stamps_ns = array('q')
        self.clock_ns = array('q')
        self.landmarks: list[Landmarks | None] = []
        self._landmark_bytes = 0

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def nbytes(self) -> int:
        """Bytes of memory held."""
        return len(self) * _BYTES + self._landmark_bytes

    def add(
        self, keyframe_id: int, stamp_ns: int, clock_ns: int, landmarks: Landmarks | None
    ) -> None:
        """Note an image; numbers and clock times rise."""
        self.ids.append(keyframe_id)
        self.stamps_ns.append(stamp_ns)
        self.clock_ns.append(clock_ns)
        self.landmarks.append(landmarks)
        self._landmark_bytes += 0 if landmarks is None else landmarks.nbytes

    def remove(self, row: int) -> None:
        """Forget an image."""
        landmarks = self.landmarks[row]
        self._landmark_bytes -= 0 if landmarks is None else landmarks.nbytes
        for values in (self.ids, self.stamps_ns, self.clock_ns, self.landmarks):
            del values[row]

    def row(self, keyframe_id: int) -> int | None:
        """Return the row of an image, None if it was forgotten."""
        row = bisect_left(self.ids, keyframe_id)
        return row if row < len(self) and self.ids[row] == keyframe_id else None

    def older_than(self, clock_ns: int) -> int:
        """Return how many images are of this clock time or before: the first ones."""
        return bisect_right(self.clock_ns, clock_ns)


# Rows from which two stages are worth it. On one core, exact against two stages, under 25
# displacements: 3.0 and 3.6 ms at 1000 rows, 7.0 and 3.9 at 2048, 13.9 and 5.1 at 4096; without
# any, which takes one pass: 0.3 and 1.7, 1.0 and 2.0, 2.0 and 2.2 ms.
TWO_STAGES_FROM = 2048
# With each new row the signs of this many others are taken anew, against the mean of today: no
# row's mean is then of less than half the images. A power of 2: they lie beside each other.
_REFRESHED = 2


class Database:
    """
    Descriptors of earlier images, compared by the centred cosine under several displacements.

    Centring (Sec. 3.1.4) subtracts from a query the mean of all queries seen so far under the
    same displacement, from a row that under none: causal, nothing from the future. The rows stay
    as they are.

    Rows are in the order of adding. An image keeps its number, which is its row until images
    before it are forgotten.

    :param rows: empty, where the vectors will be.
    :param displacements: s, how many forms a query has; the middle one is stored.
    :param center: whether to subtract the means.
    :param extractor: identity of the local features; only equal ones can be compared.
    :param groups: indices of forms that are near to each other, for the first of two stages;
        all in one by default.
    :param limit: of more than that the most redundant images are forgotten.
    """

    def __init__(
        self,
        rows: Rows,
        displacements: int,
        center: bool,
        extractor: str,
        groups: tuple[tuple[int, ...], ...] = (),
        limit: Limit | None = None,
    ) -> None:
        self.center, self.extractor = center, extractor
        self._rows, self._order = rows, Order()
        self._entries = Entries()
        self._means = Means(displacements, rows.dimensions)
        self._products = MeanProducts(rows, self._means)
        self._middle = displacements // 2
        self._groups = groups or (tuple(range(displacements)),)
        self._refreshed = 0
        self._limit = limit or Limit()
        self._redundancy = Redundancy(self._vector)
        self._added = 0
        self._likest: tuple[Hypervector | None, int | None] = None, None
        self.last_forgotten: tuple[Forgotten, ...] = ()

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def ids(self) -> Sequence[int]:
        """Return the numbers of the images."""
        return self._entries.ids

    @property
    def stamps_ns(self) -> Sequence[int]:
        """Return the header stamps of the images."""
        return self._entries.stamps_ns

    @property
    def landmarks(self) -> Sequence[Landmarks | None]:
        """Return what the images are verified by."""
        return self._entries.landmarks

    @property
    def nbytes(self) -> int:
        """Bytes of memory held by the images: vectors, unless in a file, and all else."""
        each = self._rows.row_nbytes + self._order.row_nbytes + self._redundancy.row_nbytes
        return len(self) * each + self._entries.nbytes

    @property
    def forgotten(self) -> int:
        """Return how many images were forgotten, also those that were not stored at all."""
        return self._added - len(self)

    def row(self, keyframe_id: int) -> int | None:
        """Return the row of an image, None if it was forgotten."""
        return self._entries.row(keyframe_id)

    def older_than(self, clock_ns: int, recent_rows: int) -> int:
        """
        Return how many rows may be candidates: the first ones, in the order of adding.

        :param clock_ns: rows of this clock time or before.
        :param recent_rows: but not these last ones of all.
        """
        return max(min(self._entries.older_than(clock_ns), len(self) - recent_rows), 0)

    def see(self, query: Hypervector) -> None:
        """
        Take an image into the means, whether it will be stored or not.

        :param query: (s, d) float32.
        """
        if self.center:
            self._means.see(query)

    def ask(self, query: Hypervector, count: int | None = None, *, exact: bool = False) -> Answer:
        """
        Return the centred cosine to the first rows; 0 where there is no direction to compare.

        :param query: (s, d) float32.
        :param count: rows to compare, all by default.
        :param exact: compare all of them however many they are.
        """
        count = len(self) if count is None else min(count, len(self))
        if not count:
            nothing = np.empty(0, np.float32)
            return Answer(nothing, np.empty(0, np.uint8), nothing)
        question = Question(query, self._means.of_forms())
        if exact or count < TWO_STAGES_FROM:
            answer = search_all(self._rows, self._products, self._order, count, question)
        else:
            answer = search_in_two_stages(self._rows, self._order, count, question, self._groups)
        self._likest = query, self.ids[int(answer.similarities.argmax())]
        return answer

    def add(
        self, stamp_ns: int, clock_ns: int, query: Hypervector, landmarks: Landmarks | None = None
    ) -> int | None:
        """
        Store the middle form of an image and return its number.

        In a full database the most redundant images are forgotten for it; where each shows a
        place of its own, or the new one is that image, the new one is not stored.

        :param stamp_ns: the image's header stamp.
        :param clock_ns: the same on a clock that never goes back.
        :param query: (s, d) float32.
        :param landmarks: to verify it by.
        :return: None if it was not stored.
        :raises PlaceRecognitionError: there is no room for it; nothing is changed.
        """
        self.last_forgotten = ()
        mean, number = self._means.of_rows(), self._added
        self._rows.add(query[self._middle], mean)
        self._order.append()
        if self._limit:
            self._note_likeness(query)
        self._entries.add(number, stamp_ns, clock_ns, landmarks)
        self._added += 1
        start = self._refreshed if self._refreshed < len(self._rows) else 0
        self._rows.sign(start, mean, _REFRESHED)
        self._refreshed = start + _REFRESHED
        while self._limit and len(self) and self._limit.exceeded(len(self), self.nbytes):
            row = self._redundancy.most_redundant()
            self._forget(len(self) - 1 if row is None else row)
        return None if self.row(number) is None else number

    def _note_likeness(self, query: Hypervector) -> None:
        asked, twin = self._likest
        twin = twin if asked is query else None
        twin_row = None if twin is None else self.row(twin)
        self._redundancy.add(query[self._middle], twin, twin_row)

    def _forget(self, row: int) -> None:
        number = self.ids[row]
        self._redundancy.forget(row, number)
        self._products.forget(self._order.place(row))
        self._rows.remove(self._order.place(row))
        self._order.remove(row)
        self._entries.remove(row)
        self.last_forgotten += (Forgotten(row, number),)

    def _vector(self, row: int) -> Hypervector:
        return self._rows.vector(self._order.place(row))
