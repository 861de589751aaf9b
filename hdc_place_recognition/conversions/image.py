# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Converts image messages to 8-bit gray or BGR images, for the node and for bags.

A message is any object with the fields of sensor_msgs/Image or sensor_msgs/CompressedImage.
"""

from __future__ import annotations

from array import array
from typing import Any, Protocol, TypeAlias

import cv2
from hdc_place_recognition.conversions import jpeg
from hdc_place_recognition.conversions.image_encodings import Encoding, ENCODINGS, Plane
from hdc_place_recognition.conversions.image_size import claimed_size, png_end, PNG_MAGIC
from hdc_place_recognition.conversions.pixels import as_uint8, ValueRange
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params
import numpy as np
from numpy.typing import NDArray

SUPPORTED_ENCODINGS = tuple(ENCODINGS)
Bytes: TypeAlias = 'bytes | array[int] | NDArray[np.uint8]'
_NOT_ORIENTED = cv2.IMREAD_IGNORE_ORIENTATION


class StampedMessage(Protocol):
    """Any message with a header."""

    header: Any


class ImageMessage(Protocol):
    """The fields of sensor_msgs/Image that are used."""

    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: Bytes


class CompressedMessage(Protocol):
    """The fields of sensor_msgs/CompressedImage that are used."""

    format: str  # noqa: A003, RUF100 - the field name in the message
    data: Bytes


def stamp_ns(message: StampedMessage) -> int:
    """Return the header stamp of a message as integer nanoseconds."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


class ImageConverter:
    """
    Converts the images of one camera; 16-bit and float images keep a stable brightness.

    :param max_pixels: images of more pixels are refused.
    :param oriented: turn compressed images by their EXIF orientation.
    """

    def __init__(
        self, max_pixels: int = Params.max_image_pixels, *, oriented: bool = False
    ) -> None:
        self.max_pixels, self._oriented = max_pixels, oriented
        self._values = ValueRange()

    def convert(self, message: ImageMessage | CompressedMessage) -> NDArray[np.uint8]:
        """
        Return the image of a message: gray for a single channel, otherwise BGR.

        16-bit gray, color and Bayer images are scaled by the bits that they use. 16UC1, 16SC1 and
        float images are scaled from their finite minimum and maximum to 0-255; see
        :func:`as_uint8`.

        :param message: raw image with one of `SUPPORTED_ENCODINGS`, or a compressed image in one
            of the formats of conversions/image_size.py.
        :return: (h, w) or (h, w, 3) uint8, contiguous. An 8-bit gray or BGR image without padding
            shares the memory of the message and is read-only.
        :raises PlaceRecognitionError: the encoding is not supported, height, width, step and data
            length do not match, the data cannot be decoded or are incomplete, or the image is too
            large.
        """
        if hasattr(message, 'format'):
            return self._decompressed(message.format, bytes(message.data))
        encoding = ENCODINGS.get(message.encoding)
        if encoding is None:
            raise PlaceRecognitionError(
                f'image encoding {message.encoding!r} is not supported; supported are '
                + ', '.join(SUPPORTED_ENCODINGS)
            )
        views = _views(message, encoding)
        self._check_size(int(message.width), int(message.height))
        return encoding.convert(*views, self._values)

    def _check_size(self, width: int, height: int) -> None:
        if width * height > self.max_pixels:
            raise PlaceRecognitionError(
                f'image of {width} x {height} has more than max_image_pixels = {self.max_pixels} '
                'pixels; reduce it in the driver, or raise max_image_pixels'
            )

    def _decompressed(self, format_: str, data: bytes) -> NDArray[np.uint8]:
        """Return the image that the raw message would give, before compression."""
        if 'compressedDepth' in format_:
            raise PlaceRecognitionError(
                f'compressed image of format {format_!r} holds depth: take the topic of the '
                'camera image, or the uncompressed depth'
            )
        size = claimed_size(data)
        if size is not None:
            self._check_size(*size)
        pixels = None if size is None else _decoded(data, self._oriented)
        if pixels is None:
            raise PlaceRecognitionError(
                f'compressed image of format {format_!r} and {len(data)} bytes cannot be decoded: '
                'it is cut short, damaged, or none of JPEG, PNG, WebP, TIFF, BMP and PNM'
            )
        if pixels.ndim == 3:
            # The publisher gave RGB data to an encoder that expects BGR.
            is_rgb = 'compressed rgb' in format_
            return as_uint8(pixels[..., ::-1] if is_rgb else pixels, self._values)
        sent = _compressed_encoding(format_)
        if sent is None or (sent.channels, sent.chroma, np.dtype(sent.dtype)) != (
            1,
            0,
            pixels.dtype,
        ):
            return as_uint8(pixels, self._values)
        return sent.convert(pixels, self._values)


def image_from_message(message: ImageMessage | CompressedMessage) -> NDArray[np.uint8]:
    """
    Return the image of a single message; an EXIF orientation is ignored.

    :raises PlaceRecognitionError: see :meth:`ImageConverter.convert`.
    """
    return ImageConverter().convert(message)


def _views(message: ImageMessage, encoding: Encoding) -> list[NDArray[Any]]:
    """Return read-only views of the planes; they are copied only to swap or align bytes."""
    dtype = np.dtype(encoding.dtype)
    sent = dtype.newbyteorder('>' if message.is_bigendian else '<')
    views = []
    for plane in _checked_planes(message, encoding):
        view: NDArray[Any] = np.ndarray(
            plane.shape, sent, buffer=message.data, offset=plane.offset, strides=plane.strides
        )
        view.flags.writeable = False
        # OpenCV misreads rows whose step is not a multiple of the sample size.
        views.append(np.require(view, dtype, requirements=['ALIGNED']))
    return views


def _checked_planes(message: ImageMessage, encoding: Encoding) -> list[Plane]:
    """Return the memory layout of the planes; raise an error if the data are too short."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    if height < 1 or width < 1:
        raise _unusable(message, 'at least one pixel')
    rows, columns = encoding.multiples
    if height % rows or width % columns:
        raise _unusable(message, f'a height divisible by {rows} and a width by {columns}')
    planes = encoding.planes(height, width, step)
    row = width * planes[0].strides[1]
    if step < row:
        raise _unusable(message, f'a step of at least {row} bytes')
    length = np.frombuffer(message.data, np.uint8).size
    if length < planes[-1].end:
        raise _unusable(message, f'{planes[-1].end} bytes of data, not {length}')
    return planes


def _unusable(message: ImageMessage, needed: str) -> PlaceRecognitionError:
    """Return the error for inconsistent fields of a message."""
    return PlaceRecognitionError(
        f'image of encoding {message.encoding!r}, height {message.height}, width {message.width} '
        f'and step {message.step} needs {needed}: check the driver that publishes it'
    )


def _compressed_encoding(format_: str) -> Encoding | None:
    """
    Return the encoding of the pixels that were compressed.

    The format is 'ORIGINAL; CODEC compressed COMPRESSED'. Bayer patterns and 16UC1 images are
    compressed without conversion, unless the second encoding says otherwise.
    """
    original, _, rest = format_.partition(';')
    compressed = rest.partition('compressed ')[2].strip()
    return ENCODINGS.get(compressed or original.strip())


def _decoded(data: bytes, oriented: bool) -> NDArray[Any] | None:
    """Return the decoded pixels, None if they cannot be decoded or a part is missing."""
    flags = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH
    if data.startswith(jpeg.START):
        # Completeness is checked by the last block, before the image is turned.
        stored = jpeg.decode_whole(data, lambda part: _opencv(part, flags | _NOT_ORIENTED))
        return _opencv(data, flags) if oriented and stored is not None else stored
    if data.startswith(PNG_MAGIC):
        data = data[: png_end(data)]
    return _opencv(data, flags if oriented else flags | _NOT_ORIENTED)


def _opencv(data: bytes, flags: int) -> NDArray[Any] | None:
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:  # no data, or sizes that are too large
        return None
