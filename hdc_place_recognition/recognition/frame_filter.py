# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which frames are processed, decided by their stamps alone."""

from __future__ import annotations

from hdc_place_recognition.results import Status

# A frame this much older than the last one is late; one that is older still means that the clock
# was set back, as when a simulation or a bag starts again.
CLOCK_RESET_NS = 1_000_000_000
# Standing still for longer than this does not count as time.
_REST_NS = 2_000_000_000


class FrameFilter:
    """
    Skips frames that come too soon, and keeps a clock that never goes back.

    The clock follows the stamps. It stops where they were set back, so that older keyframes stay
    older. It also stops while the robot stands still: otherwise what the robot saw just before it
    stopped would soon be old enough for a loop closure.

    :param clock_ns: time at the start.
    """

    def __init__(self, clock_ns: int = 0) -> None:
        self.clock_ns = clock_ns
        self._last_ns: int | None = None
        self._step_ns = 0
        self._still_ns = 0

    def skip_reason(self, stamp_ns: int, min_interval_ns: int) -> Status | None:
        """
        Return why a frame is skipped, None if it is not.

        :param stamp_ns: header stamp of the frame.
        :param min_interval_ns: smallest distance to the last frame that was accepted.
        """
        step = self._step(stamp_ns)
        if step is None or step <= -CLOCK_RESET_NS or step >= max(min_interval_ns, 1):
            return None
        if step == 0:
            return Status.STAMP_REPEATED
        return Status.STAMP_OUT_OF_ORDER if step < 0 else Status.TOO_SOON

    def accept(self, stamp_ns: int, min_interval_ns: int) -> Status | None:
        """Return why a frame is skipped, or None and note its stamp."""
        reason = self.skip_reason(stamp_ns, min_interval_ns)
        if reason is None:
            self._step_ns = max(self._step(stamp_ns) or 0, 0)
            self.clock_ns += self._step_ns
            self._last_ns = stamp_ns
        return reason

    def note_motion(self, moved: bool) -> None:
        """
        Take back the time of the last frame if the robot has been standing still for long.

        :param moved: whether the frame shows something new.
        """
        self._still_ns = 0 if moved else self._still_ns + self._step_ns
        self.clock_ns -= min(max(self._still_ns - _REST_NS, 0), self._step_ns)

    def _step(self, stamp_ns: int) -> int | None:
        return None if self._last_ns is None else stamp_ns - self._last_ns


def nanoseconds(seconds: float) -> int:
    """Return a time in the unit of stamps."""
    return round(seconds * 1e9)
