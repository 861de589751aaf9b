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
# Newton's method for undistortion: at most so many steps, each at most so long, until the error is
# a ten-thousandth of a pixel.
_STEPS, _LONGEST_STEP, _EXACT = 30, 0.5, 1e-7
_DERIVATIVE_STEP, _LEAST_DETERMINANT = 1e-6, 1e-3
_WIDEST = 1.5  # rad, the largest angle of a ray that meets the plane


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
        columns = points[:, None].astype(np.float64)
        seen = cv2.undistortPoints(columns, self.matrix, None)
        rays: NDArray[np.float64] = np.asarray(seen, np.float64).reshape(-1, 2)
        return self._undistorted(rays) if self.fisheye or self.distortion.any() else rays

    def _undistorted(self, distorted: NDArray[np.float64]) -> NDArray[np.float64]:
        """
        Invert the distortion by Newton's method.

        OpenCV's fixed-point iteration does not converge for wide angles.

        :param distorted: (n, 2) float64, points on the plane at distance 1.
        :return: (n, 2) float64; for points that no ray of the model reaches, the nearest that was
            found.
        """
        rays = self._first_guess(distorted)
        best, error = rays, np.full(len(rays), np.inf)
        for _ in range(_STEPS):
            values = self._distorted(rays)
            miss = values - distorted
            closer = (lengths := np.linalg.norm(miss, axis=1)) < error
            best = np.where(closer[:, None], rays, best)
            error = np.where(closer, lengths, error)
            if not (error > _EXACT).any():
                break
            rays = rays - _limited(_solved(self._jacobian(rays, values), miss))
        return best

    def _first_guess(self, distorted: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where Newton's method starts; for a fisheye the inverse of tan(angle)."""
        if not self.fisheye:
            return distorted
        angles = np.linalg.norm(distorted, axis=1, keepdims=True)
        return distorted * np.tan(np.minimum(angles, _WIDEST)) / np.maximum(angles, 1e-12)

    def _distorted(self, rays: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, 2) float64, the points at which rays (n, 2) are seen."""
        if self.fisheye:
            seen = cv2.fisheye.distortPoints(rays[:, None], np.eye(3), self.distortion)
        else:
            ones = np.column_stack([rays, np.ones(len(rays))])
            none = np.zeros(3)
            seen, _ = cv2.projectPoints(ones[:, None], none, none, np.eye(3), self.distortion)
        return np.asarray(seen, np.float64).reshape(-1, 2)

    def _jacobian(
        self, rays: NDArray[np.float64], values: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return (n, 2, 2) float64, the derivatives of the distortion at rays."""
        steps = np.eye(2) * _DERIVATIVE_STEP
        columns = [(self._distorted(rays + step) - values) / _DERIVATIVE_STEP for step in steps]
        return np.stack(columns, axis=2)


def _solved(matrices: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve (n, 2, 2) linear systems; the determinant is kept away from 0."""
    (a, b), (c, d) = matrices[:, 0].T, matrices[:, 1].T
    determinants = a * d - b * c
    sign = np.where(determinants < 0, -1.0, 1.0)
    determinants = sign * np.maximum(np.abs(determinants), _LEAST_DETERMINANT)
    x, y = values.T
    return np.stack([d * x - b * y, a * y - c * x], axis=1) / determinants[:, None]


def _limited(steps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return steps (n, 2) of finite and limited length."""
    steps = np.nan_to_num(steps, nan=0.0, posinf=_LONGEST_STEP, neginf=-_LONGEST_STEP)
    return np.clip(steps, -_LONGEST_STEP, _LONGEST_STEP)
