# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Converts images to 8-bit gray or BGR, the input of feature extraction."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, sqrt
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray

# A range of values shrinks by this share per image, so that an outlier is forgotten.
_SHRINK = 1 / 32
# Where 16-bit images use less than this share of their bits, they are scaled by their range.
_NARROW = 0.25
# Values outside these percentiles, such as dead pixels, do not count as used. They are estimated
# from about this number of pixels.
_PERCENTILES, _SAMPLES = (0.5, 99.5), 20000
_MARGIN = 0.125  # of the range, on both sides: a small change of the scene then changes nothing


class ValueRange:
    """
    The values that the images of one camera use; grows at once and shrinks slowly.

    Images of a camera are scaled by one range, so that their brightness is stable over time.
    """

    def __init__(self) -> None:
        self.bits = 8
        self._limits: tuple[float, float] | None = None

    def include_bits(self, largest: int) -> int:
        """Return the number of bits of the largest value so far, at least 8."""
        self.bits = max(self.bits, largest.bit_length())
        return self.bits

    def include(self, low: float, high: float) -> tuple[float, float]:
        """Return the limits of the range after an image with values from `low` to `high`."""
        if self._limits is not None:
            old_low, old_high = self._limits
            low = min(low, old_low + (low - old_low) * _SHRINK)
            high = max(high, old_high + (high - old_high) * _SHRINK)
        self._limits = low, high
        return self._limits


def as_uint8(image: NDArray[Any], values: ValueRange | None = None) -> NDArray[np.uint8]:
    """
    Convert an image to 8-bit gray or BGR.

    uint16 images are shifted by the bits that they use: 16-bit images lose their lower byte,
    12-bit images their lowest four bits. If they use less than a quarter of these bits, like
    thermal images, the range that they use is scaled to 0-255. float32 images are scaled from
    their finite minimum and maximum to 0-255; NaN and infinity become 0, and so does a constant
    image. Alpha is dropped before scaling.

    :param image: (h, w), (h, w, 1), (h, w, 3) BGR or (h, w, 4) BGRA, not empty, of uint8, uint16
        or float32.
    :param values: range of earlier images of the camera, which is updated; None for a single
        image.
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
    return np.ascontiguousarray(scale(pixels, values or ValueRange()))


def _used_bits(image: NDArray[np.uint16], values: ValueRange) -> NDArray[np.uint8]:
    """Return the upper 8 of the bits in use, or the scaled range of a narrow image."""
    bits = values.include_bits(int(image.max()))
    step = max(1, ceil(sqrt(image.size / _SAMPLES)))
    low, high = np.percentile(image[::step, ::step], _PERCENTILES).tolist()
    if low < high:
        low, high = values.include(low, high)
    if low < high < low + _NARROW * 2**bits:
        margin = _MARGIN * (high - low)
        # At least 255 values: noise is not amplified beyond the digits of the camera.
        return _scaled(image, low - margin, max(high + margin, low - margin + 255.0))
    return (image >> (bits - 8)).astype(np.uint8)


def _scaled(image: NDArray[Any], low: float, high: float) -> NDArray[np.uint8]:
    """Return the image scaled from `low` and `high` to 0-255; values outside are clipped."""
    # The difference of two float32 values can overflow or underflow float32, so use float64.
    scaled = np.subtract(image, low, dtype=np.float64)
    scaled *= 255.0 / (high - low)
    return np.rint(np.clip(scaled, 0.0, 255.0, out=scaled), out=scaled).astype(np.uint8)


def _scale_range(image: NDArray[np.float32], values: ValueRange) -> NDArray[np.uint8]:
    """Return the image with finite values scaled to 0-255 and other values set to 0."""
    finite = np.isfinite(image)
    low = float(np.min(image, initial=np.inf, where=finite))
    high = float(np.max(image, initial=-np.inf, where=finite))
    if not low < high:
        return np.zeros(image.shape, np.uint8)
    low, high = values.include(low, high)
    return _scaled(np.where(finite, image, np.float32(low)), low, high)


_SCALES: dict[np.dtype[Any], Callable[[NDArray[Any], ValueRange], NDArray[np.uint8]]] = {
    np.dtype(np.uint8): lambda image, values: image,
    np.dtype(np.uint16): _used_bits,
    np.dtype(np.float32): _scale_range,
}
