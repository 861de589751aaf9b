# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A calibrated camera: how far it has turned between two views of a scene."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

# x, y, z, w.
Quaternion = tuple[float, float, float, float]

_LEAST_POINTS = 8
# Half a pixel of 320, as a share of the width: with 1.5 the rotation is less exact.
_TOLERANCE, _CONFIDENCE = 0.5 / 320, 0.999
# Images of another shape are no images of this camera: they were cropped.
_ASPECT_TOLERANCE = 0.01


@dataclass(frozen=True)
class Camera:
    """
    What maps points of an image to directions.

    :param matrix: (3, 3) float64, the camera matrix with the image's width as unit of length.
    :param distortion: (n,) float64, in the order of OpenCV; all zero for rectified images.
    :param fisheye: whether they are those of the fisheye (equidistant) model.
    :param aspect: height / width of the image.
    """

    matrix: NDArray[np.float64]
    distortion: NDArray[np.float64]
    fisheye: bool
    aspect: float

    def took(self, aspect: float) -> bool:
        """Return whether an image of this aspect can be one of the camera, at any size."""
        return abs(aspect - self.aspect) <= _ASPECT_TOLERANCE * self.aspect

    def directions(self, points: NDArray[np.float32]) -> NDArray[np.float64]:
        """
        Return where the rays through points pierce the plane at distance 1.

        :param points: (n, 2) float32, in widths of the image.
        :return: (n, 2) float64.
        """
        undistort = cv2.fisheye.undistortPoints if self.fisheye else cv2.undistortPoints
        rays = undistort(points[:, None].astype(np.float64), self.matrix, self.distortion)
        return np.asarray(rays, np.float64).reshape(-1, 2)


def rotation(camera: Camera, pairs: NDArray[np.float32]) -> Quaternion | None:
    """
    Return the orientation of the query's camera in the frame of the earlier one.

    An essential matrix stands for two rotations, half a turn apart: views that have points in
    common differ by the smaller one.

    :param pairs: (n, 2, 2) float32, points of the query and of the earlier image, in widths, that
        agree with one geometry.
    :return: None where the points determine none.
    """
    if len(pairs) < _LEAST_POINTS:
        return None
    query, earlier = camera.directions(pairs[:, 0]), camera.directions(pairs[:, 1])
    tolerance = _TOLERANCE / camera.matrix[0, 0]
    try:
        essential, _ = cv2.findEssentialMat(
            query, earlier, np.eye(3), cv2.USAC_MAGSAC, _CONFIDENCE, tolerance
        )
    except cv2.error:  # of degenerate points, in some versions
        return None
    if np.shape(essential) != (3, 3) or not np.isfinite(essential).all():
        return None
    both = np.array(cv2.decomposeEssentialMat(essential)[:2], np.float64)
    return _quaternion(max(both, key=np.trace))


def _quaternion(turned: NDArray[np.float64]) -> Quaternion:
    """Return a rotation matrix as a unit quaternion with w >= 0, exact in float32."""
    axis, _ = cv2.Rodrigues(turned)
    angle = float(np.linalg.norm(axis))
    # numpy's sinc is sin(pi x) / (pi x): no division by an angle of 0.
    vector = np.asarray(axis).ravel() * (0.5 * np.sinc(angle / 2 / np.pi))
    x, y, z, w = np.array([*vector, np.cos(angle / 2)], np.float32).tolist()
    return x, y, z, w
