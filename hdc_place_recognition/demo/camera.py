# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The camera of the demo: an ideal pinhole camera that looks along the street."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hdc_place_recognition.demo.route import Pose
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Camera:
    """
    A pinhole camera with a horizontal optical axis, `height_m` above the ground.

    The sensor is shifted so that the horizon lies at the share `horizon` of the image height.
    """

    width: int
    height: int
    field_of_view_deg: float
    height_m: float
    horizon: float = 0.5

    @property
    def focal_px(self) -> float:
        """Return the focal length in pixels, equal in x and y."""
        return self.width / 2 / float(np.tan(np.radians(self.field_of_view_deg) / 2))

    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """Return the (3, 3) matrix K."""
        focal, x, y = self.focal_px, (self.width - 1) / 2, self.horizon * self.height - 0.5
        return np.array([[focal, 0, x], [0, focal, y], [0, 0, 1]])

    def magnified(self, factor: int) -> Camera:
        """Return the camera with `factor` times as many pixels in x and y."""
        return replace(self, width=self.width * factor, height=self.height * factor)

    def project(self, matrices: NDArray[np.float64], pose: Pose) -> NDArray[np.float64]:
        """Return the (n, 3, 3) homographies from (s, t, 1) to pixels (x w, y w, w), w = depth."""
        cos, sin = np.cos(pose.yaw), np.sin(pose.yaw)
        rotation = np.array([[sin, -cos, 0], [0, 0, -1], [cos, sin, 0]])
        relative = matrices.copy()
        relative[:, :, 2] -= pose.x, pose.y, self.height_m
        projected: NDArray[np.float64] = self.intrinsics @ rotation @ relative
        return projected
