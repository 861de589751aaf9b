# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Hypervectors reduced to the signs of their elements: 32 times less to read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
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


# The first part: 1024 signs tell which of many rows are worth the others.
_COARSE_WORDS = 16
# What is computed of a block stays in the cache, and is enough to be worth a call.
_BLOCK_ROWS = 2048


@dataclass(frozen=True)
class _Block:
    """Some places: their first words, a row of the matrix each, and the others of each place."""

    coarse: Signs
    fine: Signs


class SignTable:
    """
    Signs in numbered places.

    :param words: of a place.
    """

    def __init__(self, words: int) -> None:
        self._words = words
        self._coarse_words = min(words, _COARSE_WORDS)
        self._first, self._rest = slice(self._coarse_words), slice(self._coarse_words, None)
        self._blocks: list[_Block] = []

    @property
    def coarse_dimensions(self) -> int:
        """Return how many signs the first part has."""
        return self._coarse_words * WORD

    def put(self, place: int, signs: Signs) -> None:
        """Set the signs (k, w) of places in one block; the first may be the next new one."""
        if place == len(self._blocks) * _BLOCK_ROWS:
            self._blocks.append(self._new_block())
        block, inside = self._blocks[place // _BLOCK_ROWS], place % _BLOCK_ROWS
        some = slice(inside, inside + len(signs))
        block.coarse[:, some] = signs[:, self._first].T
        block.fine[some] = signs[:, self._rest]

    def get(self, place: int) -> Signs:
        """Return the signs (w,) of a place."""
        block, inside = self._blocks[place // _BLOCK_ROWS], place % _BLOCK_ROWS
        return np.concatenate([block.coarse[:, inside], block.fine[inside]])

    def keep(self, places: int) -> None:
        """Let go of memory behind the first places."""
        while len(self._blocks) > places // _BLOCK_ROWS + 1:
            self._blocks.pop()

    def coarse(self, queries: Signs, places: int) -> NDArray[np.uint16]:
        """
        Return in how many signs of the first part queries and the first places differ.

        :param queries: (b, w).
        :return: (b, places) uint16.
        """
        found = np.empty((len(queries), places), np.uint16)
        differing = np.empty((self._coarse_words, _BLOCK_ROWS), np.uint64)
        for block, start, filled in self._filled(places):
            coarse, out = block.coarse[:, :filled], differing[:, :filled]
            rows = slice(start, start + filled)
            for query, distances in zip(queries[:, self._first], found[:, rows], strict=True):
                np.bitwise_xor(coarse, query[:, None], out=out)
                np.add.reduce(count(out), axis=0, dtype=np.uint16, out=distances)
        return found

    def fine(self, queries: Signs, places: NDArray[np.intp]) -> NDArray[np.uint32]:
        """
        Return in how many signs of the other part queries and some places differ.

        :param queries: (b, w).
        :param places: (k,), rising.
        :return: (b, k) uint32.
        """
        found = np.empty((len(queries), len(places)), np.uint32)
        if not len(places):
            return found
        rest = queries[:, self._rest]
        for block, start, _ in self._filled(int(places[-1]) + 1):
            first, end = np.searchsorted(places, [start, start + _BLOCK_ROWS])
            if first == end:
                continue
            rows = block.fine[places[first:end] - start]
            differing = np.empty_like(rows)
            for query, distances in zip(rest, found[:, first:end], strict=True):
                counted = count(np.bitwise_xor(rows, query, out=differing))
                np.einsum('nw->n', counted, dtype=np.uint32, out=distances)
        return found

    def _new_block(self) -> _Block:
        rest = self._words - self._coarse_words
        return _Block(
            np.empty((self._coarse_words, _BLOCK_ROWS), np.uint64),
            np.empty((_BLOCK_ROWS, rest), np.uint64),
        )

    def _filled(self, places: int) -> Iterator[tuple[_Block, int, int]]:
        """Yield the blocks of the first places, where each starts and how many it has."""
        for start in range(0, places, _BLOCK_ROWS):
            yield self._blocks[start // _BLOCK_ROWS], start, min(places - start, _BLOCK_ROWS)
