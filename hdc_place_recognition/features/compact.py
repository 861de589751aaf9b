# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What is kept of an image so that its geometry can be checked later: 134 bytes a point."""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.local_features import LocalFeatures
import numpy as np
from numpy.typing import NDArray

_SHARES = 65535
_STEPS_PER_OCTAVE = 32
# Sizes are kept from this share of the width on, in 8 octaves.
_SMALLEST = 1 / 320
_DIRECTIONS = 256
_LEVELS = 255
# Of memory, for the object and its arrays, whatever they hold.
_OBJECTS_BYTES = 640


# Slots leave the garbage collector half as much to go through while others wait.
@dataclass(frozen=True, slots=True)
class Landmarks:
    """
    The keypoints of one image, quantised.

    :param places: (k, 2) uint16, shares of width and height.
    :param octaves: (k,) uint8, logarithms of the sizes as shares of the width.
    :param directions: (k,) uint8, angles.
    :param descriptors: (k, m) uint8.
    :param aspect: height / width of the image.
    """

    places: NDArray[np.uint16]
    octaves: NDArray[np.uint8]
    directions: NDArray[np.uint8]
    descriptors: NDArray[np.uint8]
    aspect: float

    def __len__(self) -> int:
        return len(self.places)

    @property
    def nbytes(self) -> int:
        """Bytes of memory held."""
        held = (self.places, self.octaves, self.directions, self.descriptors)
        return _OBJECTS_BYTES + sum(array.nbytes for array in held)

    @property
    def points(self) -> NDArray[np.float32]:
        """Return (k, 2) float32, x and y, both in widths of the image."""
        return self.places * np.array([1, self.aspect], np.float32) / np.float32(_SHARES)

    @property
    def shapes(self) -> NDArray[np.complex64]:
        """Return (k,) complex64: size and direction of each keypoint as one number."""
        turn = np.exp(2j * np.pi / _DIRECTIONS * self.directions)
        return (2 ** (self.octaves / _STEPS_PER_OCTAVE) * turn).astype(np.complex64)


def keep(features: LocalFeatures) -> Landmarks:
    """
    Return the compact form of features with sizes, angles and descriptors from 0 to 1.

    :raises PlaceRecognitionError: the extractor gives no sizes or angles.
    """
    if features.sizes is None or features.angles is None:
        raise PlaceRecognitionError(
            'landmarks need an extractor that gives sizes and angles, such as rootsift'
        )
    extent = np.array([features.width, features.height], np.float32)
    shares = (features.keypoints + np.float32(0.5)) / extent
    sizes = np.maximum(features.sizes / features.width, _SMALLEST)
    octaves = _STEPS_PER_OCTAVE * np.log2(sizes / _SMALLEST)
    return Landmarks(
        places=np.rint(np.clip(shares, 0, 1) * _SHARES).astype(np.uint16),
        octaves=np.clip(np.rint(octaves), 0, 255).astype(np.uint8),
        directions=(np.rint(features.angles * (_DIRECTIONS / 360)) % _DIRECTIONS).astype(np.uint8),
        descriptors=np.rint(np.clip(features.descriptors, 0, 1) * _LEVELS).astype(np.uint8),
        aspect=features.height / features.width,
    )
