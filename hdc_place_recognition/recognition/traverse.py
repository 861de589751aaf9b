# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The state of one traverse: one camera on one way through the world."""

from __future__ import annotations

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.hdc.sequence import SequenceBundler
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.frame_filter import FrameFilter
from hdc_place_recognition.recognition.keyframes import KeyframeSelector, no_odometry, Odometry
from hdc_place_recognition.verification.settings import VerificationSettings
from hdc_place_recognition.verification.temporal import TemporalSupport


class Traverse:
    """
    All that the recognizer remembers from one image to the next, besides the database.

    Two cameras, or two sessions, are two traverses; they share the database and nothing else. A
    clock that is set back ends a traverse and begins the next one.

    :param number: keyframes of one number follow each other.
    :param params: fix the sequence of images that are bundled.
    :param settings: of temporal support.
    :param clock_ns: time at the start, so that keyframes of earlier traverses are older.
    :param session: number of the session; within a session no stamp occurs twice.
    :ivar camera: that takes the images, None if it is not calibrated; may be replaced.
    :ivar odometry: returns the pose of the robot at a stamp; may be replaced.
    """

    def __init__(
        self,
        number: int,
        params: Params,
        settings: VerificationSettings,
        clock_ns: int = 0,
        session: int = 0,
    ) -> None:
        self.number, self.session = number, session
        self.filter = FrameFilter(clock_ns)
        self.sequence = SequenceBundler(
            dimensions=params.dimensions, length=params.sequence_length, seed=params.seed
        )
        self.keyframes = KeyframeSelector()
        self.temporal = TemporalSupport(settings)
        self.camera: Camera | None = None
        self.odometry: Odometry = no_odometry
