# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Where the robot was at each keyframe, by odometry."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from threading import Lock

from hdc_place_recognition.recognition.keyframes import Pose

Position = tuple[float, float, float]
UNKNOWN: Position = (float('nan'),) * 3
# Odometry messages kept for images that are still being processed.
_KEPT = 2000


@dataclass
class KeyframePositions:
    """
    Gives each keyframe the position of the odometry nearest in time.

    Odometry and keyframes may come from different threads and in any order. A keyframe is settled
    once odometry has passed its stamp, so that only a bounded history is kept.

    :param tolerance_ns: odometry further away in time is not used; may be changed at any time.
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
                keyframe_id
                for keyframe_id, keyframe_ns in self._waiting.items()
                if keyframe_ns + self.tolerance_ns <= stamp_ns
            ]
            for keyframe_id in passed:
                self._settled[keyframe_id] = self._nearest(self._waiting.pop(keyframe_id))

    def pose_before(self, stamp_ns: int) -> Pose | None:
        """Return the last pose up to a stamp, None if there is none within the tolerance."""
        with self._lock:
            for known_ns, pose in reversed(self._recent):
                if known_ns <= stamp_ns:
                    return pose if stamp_ns - known_ns <= self.tolerance_ns else None
        return None

    def add_keyframe(self, keyframe_id: int, stamp_ns: int) -> None:
        """Note the stamp of a new keyframe."""
        with self._lock:
            self._waiting[keyframe_id] = stamp_ns

    def evict(self, keyframe_id: int) -> None:
        """Forget a keyframe that the database has evicted."""
        with self._lock:
            self._waiting.pop(keyframe_id, None)
            self._settled.pop(keyframe_id, None)

    def position(self, keyframe_id: int) -> Position:
        """Return where the keyframe was taken, meters; NaN if that is not known."""
        with self._lock:
            if keyframe_id in self._waiting:
                return self._nearest(self._waiting[keyframe_id])
            return self._settled.get(keyframe_id, UNKNOWN)

    def _nearest(self, stamp_ns: int) -> Position:
        distance, position = min(
            ((abs(known_ns - stamp_ns), pose.position) for known_ns, pose in self._recent),
            default=(self.tolerance_ns + 1, UNKNOWN),
        )
        return position if distance <= self.tolerance_ns else UNKNOWN
