# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Converts sensor_msgs/CameraInfo to a camera, for the node and for bags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray

# Names that drivers use, without case, blanks, '-' and '_'. Coefficients at the end that are zero
# may be missing, or more than the model has: OpenCV takes these numbers of coefficients.
_PINHOLE = ('plumbbob', 'rationalpolynomial', 'radtan', 'brownconrady', 'thinprism')
_FISHEYE = ('equidistant', 'fisheye', 'kannalabrandt', 'kannalabrandt4')
_PINHOLE_LENGTHS, _FISHEYE_LENGTHS = (4, 5, 8, 12, 14), (4,)
_SUPPORTED = 'plumb_bob, rational_polynomial and equidistant'


class CameraInfoMessage(Protocol):
    """The fields of sensor_msgs/CameraInfo that are used."""

    height: int
    width: int
    distortion_model: str
    d: Sequence[float]
    k: Sequence[float]
    p: Sequence[float]


@dataclass(frozen=True)
class _Window:
    """
    The part of the sensor that the image shows.

    :param x: left side, y: upper side, width, height: its size, all in pixels of the sensor.
    :param binning: pixels of the sensor per pixel of the image, horizontally and vertically.
    """

    x: int
    y: int
    width: int
    height: int
    binning: tuple[int, int]

    @property
    def aspect(self) -> float:
        """Return height / width of the image."""
        return self.height / self.binning[1] / (self.width / self.binning[0])

    def normalized(self, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a camera matrix of the sensor with the width of the image as unit of length."""
        across, down = self.binning
        scale = np.array([1.0, across / down]) / self.width
        result = matrix.copy()
        result[:2, :2] *= scale[:, None]
        # In camera_info pixel centers have integer coordinates; here the corner is the origin.
        result[:2, 2] = (matrix[:2, 2] + 0.5 - [self.x, self.y]) * scale
        result[2] = 0, 0, 1
        return result


def camera_from_message(message: CameraInfoMessage, *, rectified: bool) -> Camera:
    """
    Return the camera of a CameraInfo message.

    The calibration is that of the whole sensor; the image may be a window of it (roi), with
    several pixels as one (binning).

    :param rectified: True if the images are rectified: P is used, otherwise K and D.
    :raises PlaceRecognitionError: the camera is not calibrated, or its distortion model or its
        window is not supported.
    """
    window = _window(message)
    matrix = window.normalized(_matrix(message, 'p' if rectified else 'k'))
    if not (np.isfinite(matrix).all() and matrix[0, 0] > 0 and matrix[1, 1] > 0):
        raise PlaceRecognitionError(
            f'camera_info with focal lengths {matrix[0, 0]:g} and {matrix[1, 1]:g}: the camera is '
            'not calibrated'
        )
    fisheye, distortion = False, np.zeros(4)
    if not rectified:
        fisheye, distortion = _distortion(message.distortion_model, _field(message, 'd'))
    return Camera(matrix, distortion, fisheye, window.aspect)


def _window(message: Any) -> _Window:
    """Return the window of a message; an empty roi stands for the whole sensor."""
    width, height = int(message.width), int(message.height)
    if not (width > 0 and height > 0):
        raise PlaceRecognitionError(
            f'camera_info of {width} x {height}: the size of the image is missing'
        )
    binning = tuple(max(1, int(getattr(message, f'binning_{axis}', 0))) for axis in 'xy')
    window = _Window(0, 0, width, height, (binning[0], binning[1]))
    roi = getattr(message, 'roi', None)
    if roi is not None and (roi.width or roi.height):
        x, y = int(roi.x_offset), int(roi.y_offset)
        window = _Window(x, y, int(roi.width), int(roi.height), window.binning)
    inside = window.x + window.width <= width and window.y + window.height <= height
    if min(window.width, window.height) < 1 or min(window.x, window.y) < 0 or not inside:
        raise PlaceRecognitionError(
            f'camera_info with the roi {window.width} x {window.height} at {window.x}, {window.y} '
            f'of {width} x {height}: it is not a part of the image; correct it in the driver'
        )
    return window


def _matrix(message: CameraInfoMessage, name: str) -> NDArray[np.float64]:
    """Return the left 3 x 3 part of a matrix in row-major order."""
    values = np.array(_field(message, name), np.float64)
    if values.size != {'k': 9, 'p': 12}[name]:
        raise PlaceRecognitionError(
            f'camera_info with {values.size} numbers in the matrix {name}: the camera is not '
            'calibrated'
        )
    return values.reshape(3, -1)[:, :3].copy()


def _field(message: Any, name: str) -> Sequence[float]:
    """Return a field by its ROS 2 name; ROS 1 uses upper case."""
    values: Sequence[float] = getattr(message, name if hasattr(message, name) else name.upper())
    return values


def _distortion(model: str, values: Sequence[float]) -> tuple[bool, NDArray[np.float64]]:
    """Return whether the model is that of a fisheye, and its coefficients in OpenCV's order."""
    given = np.array(values, np.float64).ravel()
    used = np.trim_zeros(given, 'b')
    name = ''.join(letter for letter in model.casefold() if letter not in ' -_')
    fisheye = name in _FISHEYE
    if not used.size:
        return fisheye, np.zeros(4)
    lengths: tuple[int, ...] = (
        _FISHEYE_LENGTHS if fisheye else _PINHOLE_LENGTHS if name in _PINHOLE else ()
    )
    length = next((length for length in lengths if length >= used.size), 0)
    if not length or given.size < min(lengths) or not np.isfinite(used).all():
        finite = '' if np.isfinite(used).all() else ', which are not all finite'
        raise PlaceRecognitionError(
            f'camera_info with distortion_model {model!r} and {given.size} coefficients{finite}; '
            f'supported are {_SUPPORTED}'
        )
    return fisheye, np.pad(used, (0, length - used.size))
