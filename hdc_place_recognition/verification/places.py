# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which keyframes are known to show one place, and which may be rivals."""

from __future__ import annotations

from hdc_place_recognition.verification.temporal import Distance


class PlaceLinks:
    """
    Accepted loop closures: which keyframe is a view of the place of an earlier one.

    :param elsewhere: keyframes further apart than this may be of different places.
    """

    def __init__(self, elsewhere: int) -> None:
        self._elsewhere = elsewhere
        self._first: dict[int, int] = {}

    def accept(self, keyframe_id: int, earlier_id: int) -> None:
        """Note that a keyframe shows the place of an earlier one."""
        self._first[keyframe_id] = self._first.get(earlier_id, earlier_id)

    def evict(self, keyframe_id: int) -> None:
        """Forget a keyframe that the database has evicted."""
        self._first.pop(keyframe_id, None)

    def distinct(self, a: int, b: int, distance: Distance) -> bool:
        """
        Return whether two keyframes may show different places, and so be rivals.

        A place that was visited twice before is no rival of itself.
        """
        for left in {a, self._first.get(a, a)}:
            for right in {b, self._first.get(b, b)}:
                # The first keyframe of both may be evicted: then its distances are unknown.
                apart = 0 if left == right else distance(left, right)
                if apart is not None and apart <= self._elsewhere:
                    return False
        return True
