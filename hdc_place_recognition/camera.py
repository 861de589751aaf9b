# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A calibrated camera."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

# x, y, z, w of a unit quaternion.
Quaternion = tuple[float, float, float, float]
# Relative difference of aspects from which an image was cropped, and is not of the camera.
_ASPECT_TOLERANCE = 0.01


@dataclass(frozen=True)
class Camera:
    """
    Maps points of an image to directions.

    :param matrix: (3, 3) float64, the camera matrix with the width of the image as unit of length.
    :param distortion: (n,) float64, in OpenCV's order; zeros for rectified images.
    :param fisheye: whether the distortion is that of the fisheye (equidistant) model.
    :param aspect: height / width of the image.
    """

    matrix: NDArray[np.float64]
    distortion: NDArray[np.float64]
    fisheye: bool
    aspect: float

    def fits(self, aspect: float) -> bool:
        """Return whether an image of this aspect can be from the camera, at any size."""
        return abs(aspect - self.aspect) <= _ASPECT_TOLERANCE * self.aspect

    def directions(self, points: NDArray[np.float32]) -> NDArray[np.float64]:
        """
        Return where the rays through points meet the plane at distance 1.

        :param points: (n, 2) float32, in widths of the image.
        :return: (n, 2) float64.
        """
        undistort = cv2.fisheye.undistortPoints if self.fisheye else cv2.undistortPoints
        rays = undistort(points[:, None].astype(np.float64), self.matrix, self.distortion)
        return np.asarray(rays, np.float64).reshape(-1, 2)
