# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Where the robot was when each keyframe was taken."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from threading import Lock

from hdc_place_recognition.recognition.keyframes import Pose

Position = tuple[float, float, float]
UNKNOWN: Position = (float('nan'),) * 3
# Odometry kept back for images that are still being processed.
_KEPT = 2000


@dataclass
class KeyframePositions:
    """
    Gives each keyframe the position of the nearest odometry, by stamp.

    Odometry and keyframes may come from different threads, in any order of each other: a keyframe
    is settled once odometry has passed it, and only a bounded history is kept.

    :param tolerance_ns: odometry further away than this is none; may be changed at any time.
    """

    tolerance_ns: int
    _recent: deque[tuple[int, Pose]] = field(default_factory=lambda: deque(maxlen=_KEPT))
    _waiting: dict[int, int] = field(default_factory=dict)
    _settled: dict[int, Position] = field(default_factory=dict)
    _lock: Lock = field(default_factory=Lock)

    def add_odometry(self, stamp_ns: int, pose: Pose) -> None:
        """Note where the robot was."""
        with self._lock:
            self._recent.append((stamp_ns, pose))
            passed = [
                row
                for row, keyframe_ns in self._waiting.items()
                if keyframe_ns + self.tolerance_ns <= stamp_ns
            ]
            for row in passed:
                self._settled[row] = self._nearest(self._waiting.pop(row))

    def pose_before(self, stamp_ns: int) -> Pose | None:
        """Return the last pose up to a stamp, None where there is none within the tolerance."""
        with self._lock:
            for known_ns, pose in reversed(self._recent):
                if known_ns <= stamp_ns:
                    return pose if stamp_ns - known_ns <= self.tolerance_ns else None
        return None

    def add_keyframe(self, row: int, stamp_ns: int) -> None:
        """Note that the image of this stamp is now the database's row."""
        with self._lock:
            self._waiting[row] = stamp_ns

    def forget(self, row: int) -> None:
        """Forget a keyframe that the database has forgotten."""
        with self._lock:
            self._waiting.pop(row, None)
            self._settled.pop(row, None)

    def position(self, row: int) -> Position:
        """Return where the row's image was taken; NaN where that is not known."""
        with self._lock:
            if row in self._waiting:
                return self._nearest(self._waiting[row])
            return self._settled.get(row, UNKNOWN)

    def _nearest(self, stamp_ns: int) -> Position:
        distance, position = min(
            ((abs(other_ns - stamp_ns), pose.position) for other_ns, pose in self._recent),
            default=(self.tolerance_ns + 1, UNKNOWN),
        )
        return position if distance <= self.tolerance_ns else UNKNOWN
