# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Images of any depth as the 8-bit gray or BGR images that local features are taken from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray


def as_uint8(image: NDArray[Any]) -> NDArray[np.uint8]:
    """
    Return an image as 8-bit gray or BGR.

    uint16 is taken as full scale, 65535 becoming 255: the lower byte is dropped. float32 has no
    scale of its own: its finite values are stretched from their least (0) to their greatest (255),
    a constant image becomes 0, and so does what is not finite.

    :param image: (h, w), (h, w, 1), (h, w, 3) or (h, w, 4), at least one pixel, of uint8, uint16
        or float32; BGR or BGRA where it has color. Alpha is dropped, it takes no part in scaling.
    :return: (h, w) or (h, w, 3), contiguous; shares the memory of a contiguous uint8 image.
    :raises PlaceRecognitionError: if shape or dtype is another.
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
    """Return the upper byte of each value: undoes both `x * 257` and `x << 8` exactly."""
    return (image >> 8).astype(np.uint8)


def _stretch(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the image with its finite values stretched to 0-255, all others 0."""
    finite = np.isfinite(image)
    low = float(np.min(image, initial=np.inf, where=finite))
    high = float(np.max(image, initial=-np.inf, where=finite))
    if not low < high:
        return np.zeros(image.shape, np.uint8)
    known = np.where(finite, image, np.float32(low))
    # In float64 for a moment: the span of a float32 image can overflow or underflow float32.
    scaled = np.subtract(known, low, dtype=np.float64)
    scaled *= 255.0 / (high - low)
    return np.rint(scaled, out=scaled).astype(np.uint8)


_SCALES: dict[np.dtype[Any], Callable[[NDArray[Any]], NDArray[np.uint8]]] = {
    np.dtype(np.uint8): lambda image: image,
    np.dtype(np.uint16): _upper_byte,
    np.dtype(np.float32): _stretch,
}
