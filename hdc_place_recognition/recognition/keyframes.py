# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which images become keyframes: those that show something new, to a robot that moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math

from hdc_place_recognition.camera import Quaternion
from hdc_place_recognition.hdc.algebra import Hypervector
from hdc_place_recognition.params.table import Params


@dataclass(frozen=True)
class Pose:
    """
    Where the robot is, in the frame of its odometry.

    :param position: x, y, z in meters.
    :param orientation: unit quaternion x, y, z, w.
    """

    position: tuple[float, float, float]
    orientation: Quaternion

    def near(self, earlier: Pose, meters: float, degrees: float) -> bool:
        """Return whether another pose is less than both away; a length of 0 is never near."""
        cosine = sum(a * b for a, b in zip(self.orientation, earlier.orientation, strict=True))
        turned = 2 * math.degrees(math.acos(min(abs(cosine), 1.0)))
        return math.dist(self.position, earlier.position) < meters and turned < degrees


# Returns the pose at a stamp in nanoseconds, None where it is not known.
Odometry = Callable[[int], Pose | None]


def no_odometry(stamp_ns: int) -> None:
    """Return that the pose is not known."""
    del stamp_ns


class KeyframeSelector:
    """Compares each image with the last keyframe."""

    def __init__(self) -> None:
        self._vector: Hypervector | None = None
        self._pose: Pose | None = None

    def novelty(self, vector: Hypervector) -> float:
        """Return 1 - cosine of (d,) with the last keyframe, 0 to 1; 1 before the first."""
        if self._vector is None:
            return 1.0
        return min(max(1.0 - float(vector @ self._vector), 0.0), 1.0)

    def moved(self, vector: Hypervector, pose: Pose | None, params: Params) -> bool:
        """
        Return whether an image differs from the last keyframe, and remember it if it does.

        :param vector: (d,) float32, the image descriptor. An image without features (zeros) always
            differs, and does not replace the last keyframe.
        :param pose: of the robot at the image, None if it is not known.
        :param params: read are keyframe_similarity, keyframe_distance_m and keyframe_angle_deg.
        """
        if self._alike(vector, params) or self._beside(pose, params):
            return False
        if vector.any():
            self._vector, self._pose = vector, pose
        return True

    def _alike(self, vector: Hypervector, params: Params) -> bool:
        if self._vector is None:
            return False
        return min(float(vector @ self._vector), 1.0) > params.keyframe_similarity

    def _beside(self, pose: Pose | None, params: Params) -> bool:
        if pose is None or self._pose is None:
            return False
        return pose.near(self._pose, params.keyframe_distance_m, params.keyframe_angle_deg)
