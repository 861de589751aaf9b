# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Keypoints in compact form, as a keyframe stores them for verification: 70 bytes each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.local_features import LocalFeatures
import numpy as np
from numpy.typing import NDArray

# Width of the image in which verification keypoints are found, pixels. More pixels take longer,
# and as many keypoints of them verify no better.
KEYPOINT_WIDTH = 320
_SHARES = 65535
_STEPS_PER_OCTAVE = 32
# The smallest size that is kept, as a share of the width; 8 octaves above it can be kept.
_SMALLEST = 1 / KEYPOINT_WIDTH
_ANGLES = 256
# Descriptors are kept at 4 bits a number, up to this number; larger ones are rare. Median inliers
# of 100 true pairs at 8 bits, and at 4 bits up to .3, .4 and .5: 30, 30, 30 and 29 on
# lip6_outdoor_part1; 59.5, 59, 58.5 and 57 on tum_fr1_desk.
_STEPS, _TOP = 15, 0.4
# Memory of the object and the headers of its arrays, bytes.
_OBJECT_BYTES = 640


# Slots halve the work of the garbage collector, which stops all threads.
@dataclass(frozen=True, slots=True)
class CompactKeypoints:
    """
    The keypoints of one image, quantized.

    :param positions: (k, 2) uint16, shares of width and height, 65535 for the whole.
    :param log_sizes: (k,) uint8, logarithms of the sizes as shares of the width, 32 an octave.
    :param angles: (k,) uint8, orientations, 256 for a full turn.
    :param packed: (k, m / 2) uint8, the descriptors, two numbers a byte.
    :param aspect: height / width of the image.
    """

    positions: NDArray[np.uint16]
    log_sizes: NDArray[np.uint8]
    angles: NDArray[np.uint8]
    packed: NDArray[np.uint8]
    aspect: float

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def nbytes(self) -> int:
        """Return the bytes of memory held."""
        arrays = (self.positions, self.log_sizes, self.angles, self.packed)
        return _OBJECT_BYTES + sum(array.nbytes for array in arrays)

    @property
    def descriptors(self) -> NDArray[np.float32]:
        """Return (k, m) float32 whole numbers from 0 to 15."""
        numbers = np.empty((len(self.packed), 2 * self.packed.shape[1]), np.float32)
        numbers[:, ::2], numbers[:, 1::2] = self.packed >> 4, self.packed & 15
        return numbers

    @property
    def unit(self) -> float:
        """Return the number that stands for 1 in a descriptor."""
        return _STEPS / _TOP

    @property
    def points(self) -> NDArray[np.float32]:
        """Return (k, 2) float32, x and y, both in widths of the image."""
        return self.positions * np.array([1, self.aspect], np.float32) / np.float32(_SHARES)

    @property
    def frames(self) -> NDArray[np.complex64]:
        """Return (k,) complex64, size (modulus) and orientation (argument) of each keypoint."""
        turn = np.exp(2j * np.pi / _ANGLES * self.angles)
        return (2 ** (self.log_sizes / _STEPS_PER_OCTAVE) * turn).astype(np.complex64)


def quantize(features: LocalFeatures) -> CompactKeypoints:
    """
    Return the compact form of features with sizes, angles and descriptors from 0 to 1.

    :raises PlaceRecognitionError: the extractor gives no sizes or angles.
    """
    if features.sizes is None or features.angles is None:
        raise PlaceRecognitionError(
            'verification needs an extractor that gives sizes and angles, such as rootsift'
        )
    extent = np.array([features.width, features.height], np.float32)
    shares = (features.keypoints + np.float32(0.5)) / extent
    sizes = np.maximum(features.sizes / features.width, _SMALLEST)
    log_sizes = _STEPS_PER_OCTAVE * np.log2(sizes / _SMALLEST)
    return CompactKeypoints(
        positions=np.rint(np.clip(shares, 0, 1) * _SHARES).astype(np.uint16),
        log_sizes=np.clip(np.rint(log_sizes), 0, 255).astype(np.uint8),
        angles=(np.rint(features.angles * (_ANGLES / 360)) % _ANGLES).astype(np.uint8),
        packed=pack(np.rint(np.clip(features.descriptors, 0, _TOP) * (_STEPS / _TOP))),
        aspect=features.height / features.width,
    )


def pack(numbers: NDArray[Any]) -> NDArray[np.uint8]:
    """Return numbers (k, m) from 0 to 15 as (k, m / 2) uint8, two a byte; m is even."""
    steps = np.clip(numbers, 0, _STEPS).astype(np.uint8)
    return steps[:, ::2] << np.uint8(4) | steps[:, 1::2]
