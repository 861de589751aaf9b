# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which images are processed, decided by their stamps alone."""

from __future__ import annotations

from hdc_place_recognition.results import Status

# An image this much older than the last one is late; one older still means that the clock was
# set back, as when a simulation or a bag starts again.
CLOCK_RESET_NS = 1_000_000_000
# Standing still for longer than this does not count as time.
_REST_NS = 2_000_000_000


class StampSelector:
    """
    Passes over images that come too soon, and keeps a clock that never goes back.

    The clock follows the stamps, and stands still where they were set back: what was seen before
    stays older than what comes after. It also stands still with the robot: otherwise what was
    seen just before it stopped would soon be old enough to be a loop closure.
    """

    def __init__(self) -> None:
        self.clock_ns = 0
        self._last_ns: int | None = None
        self._step_ns = 0
        self._still_ns = 0

    def objection(self, stamp_ns: int, min_interval_ns: int) -> Status | None:
        """
        Return why an image is to be passed over, None if it is not.

        :param stamp_ns: header stamp of the image.
        :param min_interval_ns: least distance to the last image that was admitted.
        """
        step = self._step(stamp_ns)
        if step is None or step <= -CLOCK_RESET_NS or step >= max(min_interval_ns, 1):
            return None
        if step == 0:
            return Status.STAMP_REPEATED
        return Status.STAMP_OUT_OF_ORDER if step < 0 else Status.TOO_SOON

    def admit(self, stamp_ns: int, min_interval_ns: int) -> Status | None:
        """Return the objection to an image, or None and note its stamp."""
        objection = self.objection(stamp_ns, min_interval_ns)
        if objection is None:
            self._step_ns = max(self._step(stamp_ns) or 0, 0)
            self.clock_ns += self._step_ns
            self._last_ns = stamp_ns
        return objection

    def note_motion(self, moved: bool) -> None:
        """
        Take back the time of the image just admitted if the robot has been standing long.

        :param moved: whether the image shows something new.
        """
        self._still_ns = 0 if moved else self._still_ns + self._step_ns
        self.clock_ns -= min(max(self._still_ns - _REST_NS, 0), self._step_ns)

    def restart(self) -> None:
        """Take the next image's stamp as it comes: another traverse begins."""
        self._last_ns = None

    def _step(self, stamp_ns: int) -> int | None:
        return None if self._last_ns is None else stamp_ns - self._last_ns


def nanoseconds(seconds: float) -> int:
    """Return a time in the unit of stamps."""
    return round(seconds * 1e9)
