# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Hypervectors reduced to the signs of their elements: 32 times less to read."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

WORD = 64
Signs = NDArray[np.uint64]
# Ones in pairs, in fours and in bytes, and the sum of all bytes: population count in a word.
_PAIRS, _FOURS, _BYTES, _SUM = (
    np.uint64(value)
    for value in (0x5555555555555555, 0x3333333333333333, 0x0F0F0F0F0F0F0F0F, 0x0101010101010101)
)


def words(dimensions: int) -> int:
    """Return how many words the signs of so many elements take."""
    return -(-dimensions // WORD)


def signs(vectors: NDArray[np.float32], threshold: NDArray[np.float32]) -> Signs:
    """
    Return where vectors are above a threshold, 64 elements a word; the last is filled with 0.

    :param vectors: (n, d) float32.
    :param threshold: (d,) or (n, d) float32.
    :return: (n, words(d)) uint64.
    """
    count, dimensions = vectors.shape
    packed = np.packbits(vectors > threshold, axis=1)
    if dimensions % WORD:
        packed = np.pad(packed, ((0, 0), (0, 8 * words(dimensions) - packed.shape[1])))
    return packed.view(np.uint64).reshape(count, -1)


def cosines(distances: NDArray[np.uint16], dimensions: int) -> NDArray[np.float32]:
    """Return the cosines to be expected: signs differ as often as the angle says."""
    angles = np.multiply(distances, np.float32(np.pi / dimensions), dtype=np.float32)
    return np.cos(angles, out=angles)


def nearest(distances: NDArray[np.unsignedinteger[Any]], count: int) -> NDArray[np.intp]:
    """Return the rows of the least distances in order of their numbers; of equals the first."""
    if len(distances) <= count:
        return np.arange(len(distances))
    last = np.partition(distances, count - 1)[count - 1]
    below, equal = np.flatnonzero(distances < last), np.flatnonzero(distances == last)
    return np.sort(np.concatenate([below, equal[: count - len(below)]]))


def count_in_words(bits: Signs) -> NDArray[np.uint8]:
    """Return the number of ones in each word: for numpy before 2, which cannot count bits."""
    other = bits >> np.uint64(1)
    other &= _PAIRS
    bits = bits - other
    np.right_shift(bits, np.uint64(2), out=other)
    other &= _FOURS
    bits &= _FOURS
    bits += other
    np.right_shift(bits, np.uint64(4), out=other)
    bits += other
    bits &= _BYTES
    bits *= _SUM
    bits >>= np.uint64(56)
    return bits.astype(np.uint8)


count = getattr(np, 'bitwise_count', count_in_words)
