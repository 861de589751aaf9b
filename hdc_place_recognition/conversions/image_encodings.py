# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The supported image encodings: memory layout and conversion to 8-bit gray or BGR."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
from hdc_place_recognition.conversions.pixels import as_uint8, ValueRange
import numpy as np
from numpy.typing import NDArray

Convert = Callable[..., NDArray[np.uint8]]


class Plane(NamedTuple):
    """
    Memory layout of a plane of samples in a buffer.

    :param shape: rows, columns, channels.
    :param offset: offset of the first sample, bytes.
    :param strides: distance between rows, columns and channels, bytes.
    """

    shape: tuple[int, int, int]
    offset: int
    strides: tuple[int, int, int]

    @property
    def end(self) -> int:
        """Return the end of the last sample in bytes; padding of the last row is optional."""
        rows, columns, _ = self.shape
        return self.offset + (rows - 1) * self.strides[0] + columns * self.strides[1]


@dataclass(frozen=True)
class Encoding:
    """
    One encoding of sensor_msgs/image_encodings.hpp.

    :param dtype: type of a sample.
    :param channels: number of samples per pixel.
    :param convert: returns the 8-bit image from the plane (h, w, channels), or from both planes,
        and the range of values of the camera (or None).
    :param multiples: height and width must be multiples of these numbers.
    :param chroma: horizontal and vertical subsampling of the second plane (U, V), 0 if there is
        no second plane.
    """

    dtype: type[np.generic]
    channels: int
    convert: Convert
    multiples: tuple[int, int] = (1, 1)
    chroma: int = 0

    def planes(self, height: int, width: int, step: int) -> list[Plane]:
        """
        Return the memory layout of the planes.

        :param step: distance between rows of the first plane, bytes.
        """
        item = np.dtype(self.dtype).itemsize
        pixel = self.channels * item
        planes = [Plane((height, width, self.channels), 0, (step, pixel, item))]
        if self.chroma:
            shape = (height // self.chroma, width // self.chroma, 2)
            planes.append(Plane(shape, height * step, (2 * step // self.chroma, 2, 1)))
        return planes


def _color(code: int) -> Convert:
    """Return a conversion by cv2.cvtColor."""
    return lambda pixels, values=None: as_uint8(cv2.cvtColor(pixels, code), values)


def _two_planes(code: int) -> Convert:
    """Return a conversion by cv2.cvtColorTwoPlane."""
    return lambda luma, chroma, _=None: as_uint8(cv2.cvtColorTwoPlane(luma, chroma, code))


def _nv24(
    luma: NDArray[np.uint8], chroma: NDArray[np.uint8], _: ValueRange | None = None
) -> NDArray[np.uint8]:
    """Return BGR pixels of a plane Y and a full-size plane (U, V)."""
    # OpenCV does not support NV24. Convert to UYVY with every pixel doubled.
    u, v = chroma[..., :1], chroma[..., 1:]
    uyvy = np.concatenate([u, luma, v, luma], axis=2).reshape(len(luma), -1, 2)
    return as_uint8(cv2.cvtColor(uyvy, cv2.COLOR_YUV2BGR_UYVY)[:, ::2])


def _scaled(pixels: NDArray[Any], values: ValueRange | None = None) -> NDArray[np.uint8]:
    """Return pixels scaled from their minimum and maximum to 0-255."""
    return as_uint8(pixels.astype(np.float32), values)


_RGB, _RGBA = _color(cv2.COLOR_RGB2BGR), _color(cv2.COLOR_RGBA2BGR)
_BGRA = _color(cv2.COLOR_BGRA2BGR)
# ROS names a Bayer pattern by its first four pixels, OpenCV by pixels 2 and 3 of row 2.
_RGGB, _BGGR = _color(cv2.COLOR_BayerBG2BGR), _color(cv2.COLOR_BayerRG2BGR)
_GBRG, _GRBG = _color(cv2.COLOR_BayerGR2BGR), _color(cv2.COLOR_BayerGB2BGR)
_UYVY = Encoding(np.uint8, 2, _color(cv2.COLOR_YUV2BGR_UYVY), multiples=(1, 2))
_YUYV = Encoding(np.uint8, 2, _color(cv2.COLOR_YUV2BGR_YUYV), multiples=(1, 2))
_NV12, _NV21 = _two_planes(cv2.COLOR_YUV2BGR_NV12), _two_planes(cv2.COLOR_YUV2BGR_NV21)

ENCODINGS = {
    'mono8': Encoding(np.uint8, 1, as_uint8),
    'mono16': Encoding(np.uint16, 1, as_uint8),
    'bgr8': Encoding(np.uint8, 3, as_uint8),
    'bgra8': Encoding(np.uint8, 4, _BGRA),
    'bgr16': Encoding(np.uint16, 3, as_uint8),
    'bgra16': Encoding(np.uint16, 4, _BGRA),
    'rgb8': Encoding(np.uint8, 3, _RGB),
    'rgba8': Encoding(np.uint8, 4, _RGBA),
    'rgb16': Encoding(np.uint16, 3, _RGB),
    'rgba16': Encoding(np.uint16, 4, _RGBA),
    # OpenCV types: images with 3 or 4 channels are BGR at full scale. A single channel of more
    # than 8 bits is a measurement (depth, temperature) with unknown range.
    '8UC1': Encoding(np.uint8, 1, as_uint8),
    '8UC3': Encoding(np.uint8, 3, as_uint8),
    '8UC4': Encoding(np.uint8, 4, _BGRA),
    '16UC1': Encoding(np.uint16, 1, _scaled),
    '16UC3': Encoding(np.uint16, 3, as_uint8),
    '16UC4': Encoding(np.uint16, 4, _BGRA),
    '16SC1': Encoding(np.int16, 1, _scaled),
    '32FC1': Encoding(np.float32, 1, as_uint8),
    '32FC3': Encoding(np.float32, 3, as_uint8),
    '32FC4': Encoding(np.float32, 4, _BGRA),
    'bayer_rggb8': Encoding(np.uint8, 1, _RGGB),
    'bayer_bggr8': Encoding(np.uint8, 1, _BGGR),
    'bayer_gbrg8': Encoding(np.uint8, 1, _GBRG),
    'bayer_grbg8': Encoding(np.uint8, 1, _GRBG),
    'bayer_rggb16': Encoding(np.uint16, 1, _RGGB),
    'bayer_bggr16': Encoding(np.uint16, 1, _BGGR),
    'bayer_gbrg16': Encoding(np.uint16, 1, _GBRG),
    'bayer_grbg16': Encoding(np.uint16, 1, _GRBG),
    'uyvy': _UYVY,
    'yuv422': _UYVY,
    'yuyv': _YUYV,
    'yuv422_yuy2': _YUYV,
    'nv12': Encoding(np.uint8, 1, _NV12, multiples=(2, 2), chroma=2),
    'nv21': Encoding(np.uint8, 1, _NV21, multiples=(2, 2), chroma=2),
    'nv24': Encoding(np.uint8, 1, _nv24, chroma=1),
}
