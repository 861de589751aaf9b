# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The algebra of hypervectors (paper, Sec. 3.1): vectors of R^d, mostly within [-1, 1]."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Hypervector = NDArray[np.float32]


def random_vectors(count: int, dimensions: int, rng: np.random.Generator) -> Hypervector:
    """
    Return symbols: entries -1 or 1 with equal probability (Sec. 3.1.1).

    :return: (count, dimensions) float32.
    """
    return rng.choice(np.array([-1, 1], np.float32), size=(count, dimensions))


def bind(a: Hypervector, b: Hypervector) -> Hypervector:
    """
    Bind by the elementwise product (Sec. 3.1.2).

    The result is unlike its inputs, and keeps the similarity of what is bound to the same vector.

    :param a: (..., d) float32.
    :param b: (..., d) float32.
    """
    return a * b


def unbind(bound: Hypervector, key: Hypervector) -> Hypervector:
    """
    Recover what was bound to `key`: binding undoes itself (Sec. 3.1.2).

    Exact for a key of {-1, 1}^d, approximate otherwise.
    """
    return bind(bound, key)


def bundle(vectors: Hypervector) -> Hypervector:
    """
    Superpose by the elementwise sum (Sec. 3.1.3); the result is like each input.

    :param vectors: (k, ..., d) float32; k = 0 gives the zero vector.
    :return: (..., d) float32.
    """
    return vectors.sum(axis=0, dtype=np.float32)


def normalize(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """
    Return vectors of unit length; a vector of zeros stays one.

    :param vectors: (..., n) float32.
    """
    lengths = np.sqrt(np.einsum('...n,...n->...', vectors, vectors))[..., None]
    return vectors / np.where(lengths > 0, lengths, np.float32(1))


def cosine_similarity(a: Hypervector, b: Hypervector) -> NDArray[np.float32]:
    """
    Compare by the normalized dot product, -1 to 1; 0 with a vector of zeros (Sec. 3.1.1).

    :param a: (..., d) float32.
    :param b: (..., d) float32.
    :return: (...) float32.
    """
    similarity: NDArray[np.float32] = np.einsum('...d,...d->...', normalize(a), normalize(b))
    return similarity


def blocks(dimensions: int, size: int = 256) -> Iterator[slice]:
    """
    Yield all dimensions in order, some at a time.

    The default is as many as pay a call, and few enough that what is made of them stays in the
    cache, in memory that is reused rather than asked for.
    """
    for start in range(0, dimensions, size):
        yield slice(start, min(start + size, dimensions))
