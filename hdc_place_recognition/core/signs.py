# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Hypervectors reduced to the signs of their elements: 32 times less to read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_WORD = 64
Signs = NDArray[np.uint64]
_ONES = np.array([bin(value).count('1') for value in range(1 << 16)], np.uint8)


def words(dimensions: int) -> int:
    """Return how many words the signs of so many elements take."""
    return -(-dimensions // _WORD)


def signs(vectors: NDArray[np.float32], threshold: NDArray[np.float32]) -> Signs:
    """
    Return where vectors are above a threshold, 64 elements a word; the last is filled with 0.

    :param vectors: (n, d) float32.
    :param threshold: (d,) or (n, d) float32.
    :return: (n, words(d)) uint64.
    """
    count, dimensions = vectors.shape
    packed = np.packbits(vectors > threshold, axis=1)
    if dimensions % _WORD:
        packed = np.pad(packed, ((0, 0), (0, 8 * words(dimensions) - packed.shape[1])))
    return packed.view(np.uint64).reshape(count, -1)


def distances(rows: Signs, queries: Signs) -> NDArray[np.uint32]:
    """
    Return the Hamming distance of each row to the nearest of some queries.

    :param rows: (n, w) uint64.
    :param queries: (b, w) uint64.
    :return: (n,) uint32.
    """
    differing = _count(rows[:, None] ^ queries)
    summed: NDArray[np.uint32] = np.einsum('nbw->nb', differing, dtype=np.uint32)
    return summed.min(axis=1)


def cosines(distances: NDArray[np.uint32], dimensions: int) -> NDArray[np.float32]:
    """Return the cosines to be expected: signs differ as often as the angle says."""
    return np.cos(np.float32(np.pi / dimensions) * distances.astype(np.float32))


def count_by_table(bits: Signs) -> NDArray[np.uint8]:
    """Return the number of ones in each half word: for numpy before 2, which cannot count bits."""
    return _ONES[bits.view(np.uint16)]


_count = getattr(np, 'bitwise_count', count_by_table)
