# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Converts images to 8-bit gray or BGR, the input of feature extraction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray


def as_uint8(image: NDArray[Any]) -> NDArray[np.uint8]:
    """
    Convert an image to 8-bit gray or BGR.

    uint16 images are scaled from 0-65535 to 0-255: the lower byte is dropped. float32 images are
    scaled from their finite minimum and maximum to 0-255; NaN and infinity become 0, and so does
    a constant image. Alpha is dropped before scaling.

    :param image: (h, w), (h, w, 1), (h, w, 3) BGR or (h, w, 4) BGRA, not empty, of uint8, uint16
        or float32.
    :return: (h, w) or (h, w, 3) uint8, contiguous. A contiguous uint8 input is not copied.
    :raises PlaceRecognitionError: the shape or the dtype is not supported.
    """
    scale = _SCALES.get(image.dtype)
    channels = image.shape[2] if image.ndim == 3 else 1
    if scale is None or image.ndim not in (2, 3) or channels not in (1, 3, 4) or not image.size:
        raise PlaceRecognitionError(
            f'image has shape {image.shape} and dtype {image.dtype}; needed is (h, w), (h, w, 1), '
            '(h, w, 3) or (h, w, 4), not empty, of uint8, uint16 or float32'
        )
    pixels = image.reshape(image.shape[:2]) if channels == 1 else image[..., :3]
    return np.ascontiguousarray(scale(pixels))


def _upper_byte(image: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return the upper byte of each value, the exact inverse of `x * 257` and of `x << 8`."""
    return (image >> 8).astype(np.uint8)


def _scale_range(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the image with finite values scaled to 0-255 and other values set to 0."""
    finite = np.isfinite(image)
    low = float(np.min(image, initial=np.inf, where=finite))
    high = float(np.max(image, initial=-np.inf, where=finite))
    if not low < high:
        return np.zeros(image.shape, np.uint8)
    known = np.where(finite, image, np.float32(low))
    # The difference of two float32 values can overflow or underflow float32, so use float64.
    scaled = np.subtract(known, low, dtype=np.float64)
    scaled *= 255.0 / (high - low)
    return np.rint(scaled, out=scaled).astype(np.uint8)


_SCALES: dict[np.dtype[Any], Callable[[NDArray[Any]], NDArray[np.uint8]]] = {
    np.dtype(np.uint8): lambda image: image,
    np.dtype(np.uint16): _upper_byte,
    np.dtype(np.float32): _scale_range,
}
