# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The image that an extractor looks at, and the way back to the pixels of the image given."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
# Height of the reduced image in units of the width that it may have.
LARGEST_ASPECT = 4


def as_gray(image: Image) -> Image:
    """Return a (h, w) gray or (h, w, 3) BGR image as (h, w) gray."""
    if image.ndim == 2:
        return image
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def as_bgr(image: Image) -> Image:
    """Return a (h, w) gray or (h, w, 3) BGR image as (h, w, 3) BGR."""
    if image.ndim == 3:
        return image
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8)


def reduce_to_width(image: Image, width: int, *, multiple: int = 1, smallest: int = 1) -> Image:
    """
    Return the image reduced to a width, keeping its aspect; smaller images keep their size.

    A very high image is reduced further, to a height of LARGEST_ASPECT times the width: time and
    memory grow with the area.

    :param image: (h, w) or (h, w, 3).
    :param width: of the result at most, in pixels.
    :param multiple: both sides are rounded down to multiples of this.
    :param smallest: but to no less than this: only below it is an image enlarged.
    """
    height, full_width = image.shape[:2]
    reduced, full = min(width, full_width), full_width
    if reduced * height > LARGEST_ASPECT * width * full_width:
        reduced, full = LARGEST_ASPECT * width, height
    sides = [side * reduced // full // multiple * multiple for side in (full_width, height)]
    size = [max(smallest, side) for side in sides]
    if size == [full_width, height]:
        return image
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def grid(shape: tuple[int, ...], *, step: int, first: int) -> NDArray[np.float32]:
    """
    Return the points of a regular grid, row by row, as (k, 2) float32 of x and y.

    :param shape: rows and columns.
    :param step: pixels from one point to the next.
    :param first: distance of the first point from the image's left and upper border, pixels.
    """
    y, x = np.indices(shape, np.float32).reshape(2, -1)
    return np.stack([x, y], axis=1) * np.float32(step) + np.float32(first - 0.5)


def restore(keypoints: NDArray[np.float32], reduced: Image, image: Image) -> NDArray[np.float32]:
    """
    Return keypoints of the reduced image in pixels of the image given, pixel centers at integers.

    :param keypoints: (k, 2) x and y.
    :param reduced: the image they were found in.
    :param image: the image it was reduced from.
    """
    height, width = image.shape[:2]
    scale = np.array([width / reduced.shape[1], height / reduced.shape[0]], np.float32)
    return (keypoints + np.float32(0.5)) * scale - np.float32(0.5)
