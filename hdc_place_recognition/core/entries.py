# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What is known of the images of a database besides their vectors."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right

from hdc_place_recognition.features.compact import Landmarks

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
