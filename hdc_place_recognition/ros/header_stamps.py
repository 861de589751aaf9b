# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The stamps of messages as they arrive: checked, and replaced if a driver sets none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hdc_place_recognition.conversions.image import stamp_ns
from hdc_place_recognition.errors import PlaceRecognitionError

_NS = 10**9


def checked_stamp_ns(message: Any) -> int:
    """
    Return the header stamp of a message, nanoseconds.

    :raises PlaceRecognitionError: seconds or nanoseconds are out of range.
    """
    stamp = message.header.stamp
    if stamp.sec < 0 or not 0 <= stamp.nanosec < _NS:
        raise PlaceRecognitionError(
            f'header stamp with {stamp.sec} seconds and {stamp.nanosec} nanoseconds: seconds must '
            f'not be negative, and nanoseconds must be below {_NS}; correct the driver'
        )
    return stamp_ns(message)


class HeaderStamps:
    """
    Returns the stamp of each image.

    The second stamp of 0 means that the driver sets no stamps; from then on images of stamp 0 get
    the time of their arrival. The first one may be the start of a simulation.

    :param warn: called once, with a text for the user.
    """

    def __init__(self, warn: Callable[[str], None]) -> None:
        self._warn = warn
        self._was_zero = self._unstamped = False

    def of(self, message: Any, arrival_ns: int) -> int:
        """
        Return the stamp of an image, nanoseconds.

        :param arrival_ns: time at which it arrived.
        :raises PlaceRecognitionError: see :func:`checked_stamp_ns`.
        """
        stamp = checked_stamp_ns(message)
        if stamp == 0 and self._was_zero and not self._unstamped:
            self._unstamped = True
            self._warn(
                'the header stamps of the images are 0: the times of arrival are used instead, '
                'and odometry cannot be assigned exactly; correct the driver of the camera'
            )
        self._was_zero = stamp == 0
        return arrival_ns if stamp == 0 and self._unstamped else stamp
