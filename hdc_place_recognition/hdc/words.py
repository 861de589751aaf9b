# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Words of keypoints: sparse hypervectors that need no vocabulary and no training.

A descriptor x (RootSIFT) is centered by a constant mean m and hashed by cross-polytope hashing
(A. Andoni et al., NIPS 2015). Table t has two random rotations R_t1 and R_t2. A symbol is the
signed axis that is nearest to the rotated descriptor:

    u = (x - m) / |x - m|,   h_tj = arg max over the 2 ROWS signed axes of R_tj u.

A word is the bound pair of both symbols of a table (role and filler, Sec. 3.1.2). The image is the
bundle of its words: a sparse hypervector of TABLES * (2 ROWS)^2 dimensions, of which at most
TABLES * k are 1. A word describes the appearance of a keypoint and not its position, so words
survive roll, zoom and shift.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Keypoints of an image that give words, the strongest: twice as many find no more places and make
# the index twice as large.
KEYPOINTS = 150
TABLES = 8
# Signed axes of a rotation that is cut to 64 rows: 128 symbols.
ROWS = 64
SYMBOLS = 2 * ROWS
WORDS = TABLES * SYMBOLS**2
_DESCRIPTOR = 128
_PARTS = 2
_LEAST_LENGTH = 1e-9

# Thousandths of the mean RootSIFT of 12,000 keypoints of 1/f noise images, which all images share.
ROOTSIFT_MEAN = np.array(
    [
        66,
        72,
        72,
        65,
        57,
        53,
        52,
        57,
        85,
        83,
        77,
        66,
        58,
        58,
        65,
        76,
        83,
        76,
        66,
        59,
        59,
        66,
        77,
        83,
        66,
        57,
        53,
        53,
        57,
        64,
        71,
        72,
        85,
        78,
        77,
        79,
        75,
        64,
        56,
        61,
        128,
        101,
        85,
        86,
        79,
        71,
        73,
        97,
        127,
        96,
        73,
        72,
        80,
        86,
        86,
        101,
        84,
        61,
        57,
        65,
        75,
        79,
        78,
        79,
        85,
        61,
        55,
        64,
        75,
        79,
        77,
        78,
        129,
        97,
        73,
        72,
        79,
        85,
        85,
        101,
        127,
        101,
        87,
        87,
        80,
        71,
        72,
        96,
        84,
        78,
        78,
        80,
        75,
        64,
        57,
        62,
        65,
        56,
        51,
        53,
        58,
        65,
        71,
        72,
        84,
        76,
        66,
        59,
        59,
        66,
        76,
        83,
        84,
        83,
        77,
        66,
        58,
        58,
        66,
        76,
        66,
        72,
        72,
        65,
        57,
        53,
        52,
        57,
    ],
    np.float32,
) / np.float32(1000)


class WordHasher:
    """
    Turns descriptors into words; the same seed gives the same words on every robot.

    :param mean: (128,), subtracted from descriptors of unit length before they are hashed.
    :param seed: of the random rotations.
    """

    def __init__(self, mean: NDArray[np.float32] = ROOTSIFT_MEAN, seed: int = 0) -> None:
        generator = np.random.default_rng(seed)
        rotations = [
            np.linalg.qr(generator.standard_normal((_DESCRIPTOR, _DESCRIPTOR)))[0][:ROWS]
            for _ in range(TABLES * _PARTS)
        ]
        self._rotations = np.ascontiguousarray(np.concatenate(rotations).T, np.float32)
        self._mean = mean.astype(np.float32)
        self._first = (np.arange(TABLES) * SYMBOLS**2).astype(np.int32)

    def symbols(self, descriptors: NDArray[np.float32]) -> NDArray[np.uint8]:
        """
        Return the symbols of each keypoint.

        :param descriptors: (k, 128), of any common length.
        :return: (k, TABLES, 2), from 0 to SYMBOLS - 1.
        """
        centered = _unit(_unit(descriptors) - self._mean)
        along = (centered @ self._rotations).reshape(-1, ROWS)
        axis = np.abs(along).argmax(axis=1)
        negative = along[np.arange(len(along)), axis] < 0
        return (2 * axis + negative).astype(np.uint8).reshape(-1, TABLES, _PARTS)

    def words(self, symbols: NDArray[np.uint8]) -> NDArray[np.int32]:
        """
        Return the words of an image: the bound pairs of symbols, as a set.

        :param symbols: (k, TABLES, 2).
        :return: (m,), rising, each once, from 0 to WORDS - 1.
        """
        filler, role = symbols[..., 0].astype(np.int32), symbols[..., 1].astype(np.int32)
        return np.unique(filler * SYMBOLS + role + self._first)


def _unit(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, _LEAST_LENGTH))
