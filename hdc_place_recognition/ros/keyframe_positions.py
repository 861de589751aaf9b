# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Where the robot was at each keyframe, by odometry."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
import heapq
from threading import Lock

from hdc_place_recognition.recognition.frame_filter import CLOCK_RESET_NS
from hdc_place_recognition.recognition.keyframes import Pose

Position = tuple[float, float, float]
UNKNOWN: Position = (float('nan'),) * 3
# Odometry messages kept for images that are still being processed.
_KEPT = 2000
# Odometry that was set back so many messages before the last image of a session belongs to the
# next session: that image was late.
_LATE = 50
# Odometry that goes on for so long after images were set back will not be set back too.
_BEHIND_NS = 10_000_000_000
# Keyframes that are settled by one odometry message at most, so that it takes little time.
_SETTLED_AT_ONCE = 50


@dataclass(frozen=True)
class _Stamped:
    """A pose with its stamp and the number of its message."""

    number: int
    stamp_ns: int
    pose: Pose


class KeyframePositions:
    """
    Gives each keyframe the position of the odometry nearest in time.

    Odometry and keyframes may come from different threads and in any order. A keyframe is settled
    once odometry has passed its stamp, so that only a bounded history is kept. When the clock is
    set back, odometry and images notice it one after the other; keyframes of a session get
    positions only from the odometry of that session.

    :param tolerance_ns: odometry further away in time is not used; may be changed at any time.
    """

    def __init__(self, tolerance_ns: int) -> None:
        self.tolerance_ns = tolerance_ns
        self._recent: deque[_Stamped] = deque(maxlen=_KEPT)
        self._count = 0
        # Keyframes that odometry has not passed: their stamps by id, and a heap of both. The heap
        # may hold keyframes that were evicted.
        self._waiting: dict[int, int] = {}
        self._heap: list[tuple[int, int]] = []
        self._settled: dict[int, Position] = {}
        # First odometry message of the session; the first after odometry was last set back.
        self._start = self._set_back = 0
        # Odometry still shows the time before the clock was set back, at most up to this stamp.
        self._behind_until: int | None = None
        self._lock = Lock()

    @property
    def count(self) -> int:
        """Return the number of odometry messages so far."""
        return self._count

    def add_odometry(self, stamp_ns: int, pose: Pose) -> None:
        """Note where the robot was."""
        with self._lock:
            if self._recent and stamp_ns <= self._recent[-1].stamp_ns - CLOCK_RESET_NS:
                self._on_set_back()
            self._recent.append(_Stamped(self._count, stamp_ns, pose))
            self._count += 1
            if self._behind_until is None or stamp_ns > self._behind_until:
                self._behind_until = None
                self._settle(stamp_ns - self.tolerance_ns)

    def begin_session(self, stamp_ns: int, last_count: int, count: int) -> None:
        """
        Note that the clock of the images was set back.

        :param stamp_ns: first stamp of the new session.
        :param last_count: value of :attr:`count` when the last image of the session before came.
        :param count: its value when the first image of the new session came.
        """
        with self._lock:
            went_back = self._set_back >= max(last_count - _LATE, self._start + 1)
            ends = self._set_back if went_back else count
            for keyframe_id, keyframe_ns in self._waiting.items():
                self._settled[keyframe_id] = self._nearest(keyframe_ns, ends)
            self._waiting, self._heap = {}, []
            self._start = self._set_back if went_back else last_count
            last_ns = self._recent[-1].stamp_ns if self._recent else stamp_ns
            behind = not went_back and last_ns >= stamp_ns + CLOCK_RESET_NS
            self._behind_until = last_ns + _BEHIND_NS if behind else None

    def pose_before(self, stamp_ns: int) -> Pose | None:
        """Return the last pose up to a stamp, None if there is none within the tolerance."""
        with self._lock:
            for known in self._of_session():
                if known.stamp_ns <= stamp_ns:
                    near = stamp_ns - known.stamp_ns <= self.tolerance_ns
                    return known.pose if near else None
        return None

    def add_keyframe(self, keyframe_id: int, stamp_ns: int) -> None:
        """Note the stamp of a new keyframe of this session."""
        with self._lock:
            self._waiting[keyframe_id] = stamp_ns
            heapq.heappush(self._heap, (stamp_ns, keyframe_id))

    def evict(self, keyframe_id: int) -> None:
        """Forget a keyframe that the database has evicted."""
        with self._lock:
            self._settled.pop(keyframe_id, None)
            self._waiting.pop(keyframe_id, None)
            if len(self._heap) > 2 * len(self._waiting) + _KEPT:
                self._heap = sorted((stamp, id_) for id_, stamp in self._waiting.items())

    def position(self, keyframe_id: int) -> Position:
        """Return where the keyframe was taken, meters; NaN if that is not known."""
        with self._lock:
            if keyframe_id in self._waiting:
                return self._nearest(self._waiting[keyframe_id])
            return self._settled.get(keyframe_id, UNKNOWN)

    def _on_set_back(self) -> None:
        """Note that odometry was set back with the next message."""
        self._set_back = self._count
        if self._behind_until is not None:
            self._start, self._behind_until = self._count, None

    def _settle(self, until_ns: int) -> None:
        """Settle keyframes up to a stamp."""
        for _ in range(_SETTLED_AT_ONCE):
            if not self._heap or self._heap[0][0] > until_ns:
                return
            stamp_ns, keyframe_id = heapq.heappop(self._heap)
            if self._waiting.pop(keyframe_id, None) is not None:
                self._settled[keyframe_id] = self._nearest(stamp_ns)

    def _of_session(self, end: int | None = None) -> Iterator[_Stamped]:
        """Yield the odometry of the session, the last one first."""
        for known in reversed(self._recent):
            if known.number < self._start:
                return
            if end is None or known.number < end:
                yield known

    def _nearest(self, stamp_ns: int, end: int | None = None) -> Position:
        """Return the position nearest in time, of odometry before the message with number end."""
        distance, position = min(
            (
                (abs(known.stamp_ns - stamp_ns), known.pose.position)
                for known in self._of_session(end)
            ),
            default=(self.tolerance_ns + 1, UNKNOWN),
        )
        return position if distance <= self.tolerance_ns else UNKNOWN
