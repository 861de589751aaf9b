# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
The signs of hypervectors: an index that is 32 times smaller than the vectors.

The share of equal signs of two vectors estimates the angle between them. A coarse part of the
signs decides which of many vectors are compared by all of their signs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

WORD = 64
Signs = NDArray[np.uint64]
# Masks and multiplier of the population count in a word: ones in pairs, in fours, in bytes, total.
_PAIRS, _FOURS, _BYTES, _SUM = (
    np.uint64(value)
    for value in (0x5555555555555555, 0x3333333333333333, 0x0F0F0F0F0F0F0F0F, 0x0101010101010101)
)
# The coarse part: 1024 signs rank many vectors well enough to choose from them (hdc_benchmark).
_COARSE_WORDS = 16
# A block of slots whose intermediate results stay in the cache of the processor.
_BLOCK_SLOTS = 2048


def word_count(dimensions: int) -> int:
    """Return the number of 64-bit words that hold the signs of a vector."""
    return -(-dimensions // WORD)


def signs(vectors: NDArray[np.float32], threshold: NDArray[np.float32]) -> Signs:
    """
    Return which elements are above a threshold, 64 elements a word; the last is padded with 0.

    :param vectors: (n, d) float32.
    :param threshold: (d,) or (n, d) float32.
    :return: (n, word_count(d)) uint64.
    """
    count, dimensions = vectors.shape
    packed = np.packbits(vectors > threshold, axis=1)
    if dimensions % WORD:
        packed = np.pad(packed, ((0, 0), (0, 8 * word_count(dimensions) - packed.shape[1])))
    return packed.view(np.uint64).reshape(count, -1)


def cosines(distances: NDArray[np.uint16], dimensions: int) -> NDArray[np.float32]:
    """
    Return the expected cosines of vectors whose signs differ in so many elements.

    Signs of random directions differ with probability angle / pi (Goemans and Williamson, 1995).
    """
    angles = np.multiply(distances, np.float32(np.pi / dimensions), dtype=np.float32)
    return np.cos(angles, out=angles)


def nearest(distances: NDArray[np.unsignedinteger[Any]], count: int) -> NDArray[np.intp]:
    """Return the indices of the smallest distances, rising; of equal ones the first."""
    if len(distances) <= count:
        return np.arange(len(distances))
    last = np.partition(distances, count - 1)[count - 1]
    below, equal = np.flatnonzero(distances < last), np.flatnonzero(distances == last)
    return np.sort(np.concatenate([below, equal[: count - len(below)]]))


def count_in_words(bits: Signs) -> NDArray[np.uint8]:
    """Return the number of ones in each word, for numpy before 2.0, which has no bitwise_count."""
    shifted = bits >> np.uint64(1)
    shifted &= _PAIRS
    bits = bits - shifted
    np.right_shift(bits, np.uint64(2), out=shifted)
    shifted &= _FOURS
    bits &= _FOURS
    bits += shifted
    np.right_shift(bits, np.uint64(4), out=shifted)
    bits += shifted
    bits &= _BYTES
    bits *= _SUM
    bits >>= np.uint64(56)
    return bits.astype(np.uint8)


bit_count = getattr(np, 'bitwise_count', count_in_words)


@dataclass(frozen=True)
class _Block:
    """Signs of some slots: the coarse words, transposed, and the other words of each slot."""

    coarse: Signs
    fine: Signs


class SignIndex:
    """
    Signs of vectors in numbered slots.

    :param words: number of words of a vector.
    """

    def __init__(self, words: int) -> None:
        self._words = words
        self._coarse_words = min(words, _COARSE_WORDS)
        self._first, self._rest = slice(self._coarse_words), slice(self._coarse_words, None)
        self._blocks: list[_Block] = []

    @property
    def coarse_dimensions(self) -> int:
        """Return the number of signs in the coarse part."""
        return self._coarse_words * WORD

    def put(self, slot: int, signs: Signs) -> None:
        """Set the signs (k, w) of slots of one block; the first may be the next new slot."""
        if slot == len(self._blocks) * _BLOCK_SLOTS:
            self._blocks.append(self._new_block())
        block, inside = self._blocks[slot // _BLOCK_SLOTS], slot % _BLOCK_SLOTS
        target = slice(inside, inside + len(signs))
        block.coarse[:, target] = signs[:, self._first].T
        block.fine[target] = signs[:, self._rest]

    def get(self, slot: int) -> Signs:
        """Return the signs (w,) of a slot."""
        block, inside = self._blocks[slot // _BLOCK_SLOTS], slot % _BLOCK_SLOTS
        return np.concatenate([block.coarse[:, inside], block.fine[inside]])

    def truncate(self, slots: int) -> None:
        """Free the memory behind the first slots."""
        while len(self._blocks) > slots // _BLOCK_SLOTS + 1:
            self._blocks.pop()

    def coarse(self, queries: Signs, slots: int) -> NDArray[np.uint16]:
        """
        Return in how many coarse signs queries differ from the vectors of the first slots.

        :param queries: (b, w).
        :return: (b, slots) uint16.
        """
        found = np.empty((len(queries), slots), np.uint16)
        differing = np.empty((self._coarse_words, _BLOCK_SLOTS), np.uint64)
        for block, start, filled in self._filled(slots):
            coarse, out = block.coarse[:, :filled], differing[:, :filled]
            target = slice(start, start + filled)
            for query, distances in zip(queries[:, self._first], found[:, target], strict=True):
                np.bitwise_xor(coarse, query[:, None], out=out)
                np.add.reduce(bit_count(out), axis=0, dtype=np.uint16, out=distances)
        return found

    def fine(self, queries: Signs, slots: NDArray[np.intp]) -> NDArray[np.uint32]:
        """
        Return in how many of the other signs queries differ from the vectors of some slots.

        :param queries: (b, w).
        :param slots: (k,), rising.
        :return: (b, k) uint32.
        """
        found = np.empty((len(queries), len(slots)), np.uint32)
        if not len(slots):
            return found
        rest = queries[:, self._rest]
        for block, start, _ in self._filled(int(slots[-1]) + 1):
            first, end = np.searchsorted(slots, [start, start + _BLOCK_SLOTS])
            if first == end:
                continue
            vectors = block.fine[slots[first:end] - start]
            differing = np.empty_like(vectors)
            for query, distances in zip(rest, found[:, first:end], strict=True):
                counted = bit_count(np.bitwise_xor(vectors, query, out=differing))
                np.einsum('nw->n', counted, dtype=np.uint32, out=distances)
        return found

    def _new_block(self) -> _Block:
        rest = self._words - self._coarse_words
        return _Block(
            np.empty((self._coarse_words, _BLOCK_SLOTS), np.uint64),
            np.empty((_BLOCK_SLOTS, rest), np.uint64),
        )

    def _filled(self, slots: int) -> Iterator[tuple[_Block, int, int]]:
        """Yield the blocks of the first slots, the first slot of each and how many it holds."""
        for start in range(0, slots, _BLOCK_SLOTS):
            yield self._blocks[start // _BLOCK_SLOTS], start, min(slots - start, _BLOCK_SLOTS)
