# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Keypoints in compact form, as a keyframe stores them for verification: 134 bytes each."""

from __future__ import annotations

from dataclasses import dataclass

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
_LEVELS = 255
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
    :param descriptors: (k, m) uint8.
    :param aspect: height / width of the image.
    """

    positions: NDArray[np.uint16]
    log_sizes: NDArray[np.uint8]
    angles: NDArray[np.uint8]
    descriptors: NDArray[np.uint8]
    aspect: float

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def nbytes(self) -> int:
        """Return the bytes of memory held."""
        arrays = (self.positions, self.log_sizes, self.angles, self.descriptors)
        return _OBJECT_BYTES + sum(array.nbytes for array in arrays)

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
        descriptors=np.rint(np.clip(features.descriptors, 0, 1) * _LEVELS).astype(np.uint8),
        aspect=features.height / features.width,
    )
