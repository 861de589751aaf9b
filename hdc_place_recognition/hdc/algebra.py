# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
The algebra of hypervectors (paper, Sec. 3.1): vectors of R^d, mostly within [-1, 1].

The functions are the MAP architecture (multiply, add, permute) with real elements, which the paper
uses. :class:`VSA` is what every vector symbolic architecture offers, and :data:`MAP` is this one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Hypervector = NDArray[np.float32]


class VSA(Protocol):
    """
    A vector symbolic architecture: the operations that encode an image (Sec. 3.1).

    All vectors are float32 arrays of shape (..., d).
    """

    def random_vectors(self, count: int, dimensions: int, rng: np.random.Generator) -> Hypervector:
        """Return (count, dimensions) random symbols, pairwise nearly orthogonal."""

    def embed(self, projected: NDArray[np.float32]) -> Hypervector:
        """Return projected descriptors (..., d) as vectors of the architecture."""

    def bind(self, a: Hypervector, b: Hypervector) -> Hypervector:
        """Return a vector unlike both inputs; keeps similarities between vectors with one key."""

    def unbind(self, bound: Hypervector, key: Hypervector) -> Hypervector:
        """Return what was bound to `key`, exactly or approximately."""

    def bundle(self, vectors: Hypervector) -> Hypervector:
        """Return a (..., d) vector similar to each of `vectors` (k, ..., d)."""

    def permute(self, vectors: Hypervector, steps: int) -> Hypervector:
        """Return vectors unlike their inputs; the same with `-steps` undoes it."""

    def similarity(self, a: Hypervector, b: Hypervector) -> NDArray[np.float32]:
        """Return the similarity of vectors, at most 1; about 0 for unrelated ones."""


def random_vectors(count: int, dimensions: int, rng: np.random.Generator) -> Hypervector:
    """
    Return symbols: elements -1 or 1 with equal probability (Sec. 3.1.1).

    >>> random_vectors(2, 4, np.random.default_rng(0)).shape
    (2, 4)

    :return: (count, dimensions) float32.
    """
    return rng.choice(np.array([-1, 1], np.float32), size=(count, dimensions))


def bind(a: Hypervector, b: Hypervector) -> Hypervector:
    """
    Bind by the elementwise product, a * b (Sec. 3.1.2).

    The result is unlike both inputs. Binding two vectors to the same third one keeps their
    similarity.

    >>> bind(np.array([1, -1, 2], np.float32), np.array([-1, -1, 1], np.float32)).tolist()
    [-1.0, 1.0, 2.0]

    :param a: (..., d) float32.
    :param b: (..., d) float32.
    """
    return a * b


def unbind(bound: Hypervector, key: Hypervector) -> Hypervector:
    """
    Recover the vector that was bound to `key`: binding is its own inverse (Sec. 3.1.2).

    Exact for a key of {-1, 1}^d, approximate otherwise.
    """
    return bind(bound, key)


def bundle(vectors: Hypervector) -> Hypervector:
    """
    Superpose by the elementwise sum (Sec. 3.1.3); the result is similar to each input.

    >>> bundle(np.array([[1, -1, 1], [1, 1, -1], [1, -1, -1]], np.float32)).tolist()
    [3.0, -1.0, -1.0]

    :param vectors: (k, ..., d) float32; k = 0 gives the zero vector.
    :return: (..., d) float32.
    """
    return vectors.sum(axis=0, dtype=np.float32)


def permute(vectors: Hypervector, steps: int) -> Hypervector:
    """
    Rotate the elements by some steps; the opposite number of steps undoes it.

    A random vector and its permutation are nearly orthogonal, which protects the order of what is
    bundled.

    >>> permute(np.array([1, 2, 3], np.float32), 1).tolist()
    [3.0, 1.0, 2.0]

    :param vectors: (..., d) float32.
    """
    return np.roll(vectors, steps, axis=-1)


def normalize(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """
    Return vectors of unit length; a zero vector stays zero.

    :param vectors: (..., n) float32.
    """
    lengths = np.sqrt(np.einsum('...n,...n->...', vectors, vectors))[..., None]
    return vectors / np.where(lengths > 0, lengths, np.float32(1))


def cosine_similarity(a: Hypervector, b: Hypervector) -> NDArray[np.float32]:
    """
    Compare by the normalized dot product, -1 to 1; 0 with a zero vector (Sec. 3.1.1).

    >>> float(cosine_similarity(np.array([3, 0], np.float32), np.array([1, 0], np.float32)))
    1.0

    :param a: (..., d) float32.
    :param b: (..., d) float32.
    :return: (...) float32.
    """
    similarity: NDArray[np.float32] = np.einsum('...d,...d->...', normalize(a), normalize(b))
    return similarity


class _RealMAP:
    """MAP with real elements: the architecture of the paper (Sec. 3.1)."""

    random_vectors = staticmethod(random_vectors)
    bind = staticmethod(bind)
    unbind = staticmethod(unbind)
    bundle = staticmethod(bundle)
    permute = staticmethod(permute)
    similarity = staticmethod(cosine_similarity)

    def embed(self, projected: NDArray[np.float32]) -> Hypervector:
        """Return the projected descriptors: real vectors are vectors of MAP as they are."""
        return projected


MAP: VSA = _RealMAP()


def blocks(dimensions: int, size: int = 256) -> Iterator[slice]:
    """
    Yield slices that cover all dimensions in order.

    A block of the default size is large enough to outweigh the cost of a numpy call, and small
    enough for its intermediate results to stay in the cache of the processor.
    """
    for start in range(0, dimensions, size):
        yield slice(start, min(start + size, dimensions))
