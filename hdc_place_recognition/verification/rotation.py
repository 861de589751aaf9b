# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""How far a calibrated camera has turned between two views of a scene."""

from __future__ import annotations

import cv2
from hdc_place_recognition.camera import Camera, Quaternion
from hdc_place_recognition.features.compact import KEYPOINT_WIDTH
import numpy as np
from numpy.typing import NDArray

_LEAST_POINTS = 8
# Half a pixel, as a share of the width. With 1.5 pixels the median error on tum_fr1_desk,
# whose rotations are known from motion capture, is larger.
_TOLERANCE, _CONFIDENCE = 0.5 / KEYPOINT_WIDTH, 0.999


def relative_rotation(camera: Camera, pairs: NDArray[np.float32]) -> Quaternion | None:
    """
    Return the orientation of the query's camera in the frame of the keyframe's camera.

    An essential matrix has two rotations, half a turn apart. Two views with common points differ
    by the smaller one.

    :param pairs: (n, 2, 2) float32, points of the query and of the keyframe, in widths of the
        image, that agree with one geometry.
    :return: None where the points determine no rotation.
    """
    if len(pairs) < _LEAST_POINTS:
        return None
    query, keyframe = camera.directions(pairs[:, 0]), camera.directions(pairs[:, 1])
    tolerance = _TOLERANCE / camera.matrix[0, 0]
    try:
        essential, _ = cv2.findEssentialMat(
            query, keyframe, np.eye(3), cv2.USAC_MAGSAC, _CONFIDENCE, tolerance
        )
    except cv2.error:  # raised for degenerate points by some versions
        return None
    if np.shape(essential) != (3, 3) or not np.isfinite(essential).all():
        return None
    both = np.array(cv2.decomposeEssentialMat(essential)[:2], np.float64)
    return _quaternion(max(both, key=np.trace))


def _quaternion(rotation: NDArray[np.float64]) -> Quaternion:
    """Return a rotation matrix as a unit quaternion with w >= 0, exact in float32."""
    axis, _ = cv2.Rodrigues(rotation)
    angle = float(np.linalg.norm(axis))
    # numpy's sinc is sin(pi x) / (pi x), so an angle of 0 is no division by zero.
    vector = np.asarray(axis).ravel() * (0.5 * np.sinc(angle / 2 / np.pi))
    x, y, z, w = np.array([*vector, np.cos(angle / 2)], np.float32).tolist()
    return x, y, z, w
