# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which frames are processed, and how much time passes between them, by their stamps alone."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from statistics import median_low

from hdc_place_recognition.results import Status

# A frame this much older than the last one is late; one that is older still means that the clock
# was set back, as when a simulation or a bag starts again.
CLOCK_RESET_NS = 1_000_000_000
# Standing still for longer than this does not count as time.
_REST_NS = 2_000_000_000
# A longer step is a jump of the clock or a gap: it counts as so many usual steps, or as this time
# if that is more.
_USUAL_STEPS = 2
_SHORT_NS = 1_000_000_000
# Frames that the usual step is estimated from.
_WINDOW = 16
# Time between frames without stamps. A camera with 10 Hz or more is meant: if the frames are
# further apart, keyframes only become candidates later.
_UNSTAMPED_STEP_NS = 100_000_000


@dataclass
class _Jump:
    """
    The last jump ahead of the stamps, to which they may return.

    :param before_ns: last stamp before the jump.
    :param after_ns: first stamp after it.
    :param clock_ns: time of the clock before the jump.
    """

    before_ns: int
    after_ns: int
    clock_ns: int


class FrameFilter:
    """
    Skips frames that come too soon, and keeps a clock that never goes back.

    The clock follows the stamps. A jump ahead counts as a few usual steps, so that a wrong stamp
    makes no keyframe old, and stamps that return from a jump continue as if there had been none.
    Stamps that are set back otherwise begin a new session: within a session no stamp occurs twice.
    The clock stands still while the robot does: otherwise what the robot saw just before it
    stopped would soon be old enough for a loop closure.

    :param clock_ns: time at the start.
    """

    def __init__(self, clock_ns: int = 0) -> None:
        self.clock_ns = clock_ns
        self._step_ns = 0
        self._still_ns = 0
        self._last_ns: int | None = None
        self._restart()

    def skip_reason(self, stamp_ns: int, min_interval_ns: int) -> Status | None:
        """
        Return why a frame is skipped, None if it is not.

        :param stamp_ns: header stamp of the frame. A second frame with stamp 0 means that the
            camera sets no stamps: no frame of stamp 0 is skipped then.
        :param min_interval_ns: smallest distance to the last frame that was accepted.
        """
        step = self._step(stamp_ns)
        if step is None or step <= -CLOCK_RESET_NS or step >= max(min_interval_ns, 1):
            return None
        if step == 0:
            return Status.STAMP_REPEATED if stamp_ns else None
        return Status.STAMP_OUT_OF_ORDER if step < 0 else Status.TOO_SOON

    def begins_session(self, stamp_ns: int) -> bool:
        """Return whether the clock was set back, or the stamp may occur twice in this session."""
        step = self._step(stamp_ns)
        if step is None or -CLOCK_RESET_NS < step <= 0:
            return False
        return self._was_used(stamp_ns) or (step < 0 and not self._returns(stamp_ns))

    def accept(self, stamp_ns: int, min_interval_ns: int) -> Status | None:
        """Return why a frame is skipped, or None and note its stamp."""
        reason = self.skip_reason(stamp_ns, min_interval_ns)
        if reason is None:
            if self.begins_session(stamp_ns):
                self._restart()
            self._step_ns = self._advance(stamp_ns)
            self.clock_ns += self._step_ns
            self._last_ns = stamp_ns
            self._stamps.append(stamp_ns)
        return reason

    def note_motion(self, moved: bool) -> None:
        """
        Take back the time of the last frame if the robot has been standing still for long.

        :param moved: whether the frame shows something new.
        """
        self._still_ns = 0 if moved else self._still_ns + self._step_ns
        self.clock_ns -= min(max(self._still_ns - _REST_NS, 0), self._step_ns)

    def _restart(self) -> None:
        """Forget the stamps of the session before."""
        self._last_ns = None
        self._stamps: deque[int] = deque(maxlen=_WINDOW)
        self._jump: _Jump | None = None
        # First and last of the stamps after a jump from which the stamps have returned.
        self._used: tuple[int, int] | None = None
        # Time that was counted after such a jump, and did not pass.
        self._debt_ns = 0

    def _step(self, stamp_ns: int) -> int | None:
        return None if self._last_ns is None else stamp_ns - self._last_ns

    def _advance(self, stamp_ns: int) -> int:
        """Return how much time has passed since the last frame, nanoseconds."""
        step = self._step(stamp_ns)
        if step is None or self._last_ns is None:
            return 0
        if step == 0:
            return _UNSTAMPED_STEP_NS
        if step < 0:
            self._return_to(stamp_ns)
            return 0
        limit = _SHORT_NS if step <= _SHORT_NS else max(_SHORT_NS, self._longest_ns())
        if step > limit:
            self._jump = _Jump(self._last_ns, stamp_ns, self.clock_ns)
        passed = min(step, limit)
        paid = min(passed, self._debt_ns)
        self._debt_ns -= paid
        return passed - paid

    def _longest_ns(self) -> int:
        """Return the longest step that is no jump, by the median step of the last frames."""
        steps = [late - early for early, late in pairwise(self._stamps)]
        return _USUAL_STEPS * median_low(steps) if steps else 0

    def _returns(self, stamp_ns: int) -> bool:
        """Return whether a stamp lies in the gap that the last jump has left."""
        jump = self._jump
        return jump is not None and jump.before_ns < stamp_ns < jump.after_ns

    def _was_used(self, stamp_ns: int) -> bool:
        """Return whether the stamps were ahead here before they returned."""
        return self._used is not None and self._used[0] <= stamp_ns <= self._used[1]

    def _return_to(self, stamp_ns: int) -> None:
        """Continue behind the last jump ahead."""
        jump, last = self._jump, self._last_ns
        if jump is None or last is None:
            return
        first, end = self._used or (jump.after_ns, last)
        self._used = (min(first, jump.after_ns), max(end, last))
        passed = self.clock_ns - jump.clock_ns
        self._debt_ns = max(passed - (stamp_ns - jump.before_ns), 0)
        self._jump = None


def nanoseconds(seconds: float) -> int:
    """Return a time in the unit of stamps."""
    return round(seconds * 1e9)
