# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Converts sensor_msgs/CameraInfo to a camera, for the node and for bags."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray

# Distortion models of sensor_msgs/distortion_models, with the allowed numbers of coefficients.
_LENGTHS = {
    'plumb_bob': (0, 4, 5),
    'rational_polynomial': (0, 8, 12, 14),
    'equidistant': (0, 4),
}
_FISHEYE = 'equidistant'


class CameraInfoMessage(Protocol):
    """The fields of sensor_msgs/CameraInfo that are used."""

    height: int
    width: int
    distortion_model: str
    d: Sequence[float]
    k: Sequence[float]
    p: Sequence[float]


def camera_from_message(message: CameraInfoMessage, *, rectified: bool) -> Camera:
    """
    Return the camera of a CameraInfo message.

    :param rectified: True if the images are rectified: P is used, otherwise K and D.
    :raises PlaceRecognitionError: the camera is not calibrated, or its distortion model is not
        supported.
    """
    if not (message.width and message.height):
        raise PlaceRecognitionError(
            f'camera_info of {message.width} x {message.height}: the size of the image is missing'
        )
    matrix = _matrix(message, 'p' if rectified else 'k') / message.width
    if not (np.isfinite(matrix).all() and matrix[0, 0] > 0 and matrix[1, 1] > 0):
        raise PlaceRecognitionError(
            f'camera_info with focal lengths {matrix[0, 0]:g} and {matrix[1, 1]:g}: the camera is '
            'not calibrated'
        )
    # In camera_info pixel centers have integer coordinates; here the image corner is the origin.
    matrix[:2, 2] += 0.5 / message.width
    matrix[2, 2] = 1.0
    model = '' if rectified else message.distortion_model
    return Camera(
        matrix=matrix,
        distortion=np.zeros(4) if rectified else _distortion(model, _field(message, 'd')),
        fisheye=model == _FISHEYE,
        aspect=message.height / message.width,
    )


def _matrix(message: CameraInfoMessage, name: str) -> NDArray[np.float64]:
    """Return the left 3 x 3 part of a matrix in row-major order."""
    return np.array(_field(message, name), np.float64).reshape(3, -1)[:, :3].copy()


def _field(message: Any, name: str) -> Sequence[float]:
    """Return a field by its ROS 2 name; ROS 1 uses upper case."""
    values: Sequence[float] = getattr(message, name if hasattr(message, name) else name.upper())
    return values


def _distortion(model: str, values: Sequence[float]) -> NDArray[np.float64]:
    """Return (n,) distortion coefficients in the order of OpenCV, four zeros for none."""
    coefficients = np.array(values, np.float64)
    if not coefficients.any():
        return np.zeros(4)
    if len(coefficients) not in _LENGTHS.get(model, ()):
        raise PlaceRecognitionError(
            f'camera_info with distortion_model {model!r} and {len(coefficients)} coefficients; '
            f'supported are {", ".join(_LENGTHS)}'
        )
    return coefficients
