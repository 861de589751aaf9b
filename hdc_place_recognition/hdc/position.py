# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Image positions as hypervectors (paper, Sec. 3.1.5)."""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.hdc import algebra
from hdc_place_recognition.hdc.algebra import Hypervector, MAP, VSA
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Splits:
    """
    Where positions along one axis change from one basis vector to the next.

    :param left: (...) intp, index of the basis vector on the left of each position.
    :param alpha: (...) intp, first dimension taken from the right one, 0 to d (Eq. 2).
    """

    left: NDArray[np.intp]
    alpha: NDArray[np.intp]

    def show(self, basis: Hypervector, block: slice) -> Hypervector:
        """
        Return the elements of the positions in a block of dimensions (Eq. 2), (..., t) float32.

        In a short block most positions use one basis vector; only those that change to the right
        one inside the block are computed dimension by dimension.
        """
        shown = basis[:, block].take(self.left + (self.alpha <= block.start), axis=0)
        changes = (self.alpha > block.start) & (self.alpha < block.stop)
        right = basis[self.left[changes] + 1, block]
        from_right = np.arange(block.start, block.stop) >= self.alpha[changes][:, None]
        shown[changes] = np.where(from_right, right, shown[changes])
        return shown


class PositionEncoder:
    """
    Encodes positions (x, y) as P = X * Y (Eq. 1-2).

    Each axis is divided into equal subintervals, with a random basis vector on every border. A
    position takes its dimensions up to alpha from the left basis vector of its subinterval, and
    the others from the right one: near positions share most dimensions, also across borders.

    :param dimensions: d, length of the vectors.
    :param n_x: horizontal subintervals, hence n_x + 1 basis vectors.
    :param n_y: vertical subintervals.
    :param seed: of the basis vectors.
    :param vsa: the architecture of the vectors.
    """

    def __init__(self, *, dimensions: int, n_x: int, n_y: int, seed: int, vsa: VSA = MAP) -> None:
        self.dimensions, self.n_x, self.n_y, self._vsa = dimensions, n_x, n_y, vsa
        rng_x, rng_y = (np.random.default_rng([seed, axis]) for axis in (0, 1))
        self.basis_x = vsa.random_vectors(n_x + 1, dimensions, rng_x)
        self.basis_y = vsa.random_vectors(n_y + 1, dimensions, rng_y)

    def encode(self, features: LocalFeatures) -> Hypervector:
        """Return (k, d) float32, the role vector P of the position of each feature (Eq. 1)."""
        x, y = features.keypoints.T
        vectors_x = self.encode_x(x, features.width)
        return self._vsa.bind(vectors_x, self.encode_y(y, features.height))

    def encode_x(self, x: NDArray[np.float32], width: int) -> Hypervector:
        """Return the vectors X of (...) horizontal positions in pixels, as (..., d) float32."""
        return self.splits_x(x, width).show(self.basis_x, slice(0, self.dimensions))

    def encode_y(self, y: NDArray[np.float32], height: int) -> Hypervector:
        """Return the vectors Y of (...) vertical positions in pixels, as (..., d) float32."""
        return self.splits_y(y, height).show(self.basis_y, slice(0, self.dimensions))

    def nodes(self, block: slice) -> Hypervector:
        """Return all pairs of basis vectors, bound, in a block: (n_x + 1)(n_y + 1), y fastest."""
        pairs = algebra.bind(self.basis_x[:, None, block], self.basis_y[None, :, block])
        return pairs.reshape(-1, pairs.shape[-1])

    def splits_x(self, x: NDArray[np.float32], width: int) -> Splits:
        """Return where the vectors of horizontal positions change."""
        return _splits(x, width, self.n_x, self.dimensions)

    def splits_y(self, y: NDArray[np.float32], height: int) -> Splits:
        """Return where the vectors of vertical positions change."""
        return _splits(y, height, self.n_y, self.dimensions)


def _splits(position: NDArray[np.float32], extent: int, parts: int, dimensions: int) -> Splits:
    """
    Return subinterval and alpha of positions in [0, extent - 1]; others are moved to its ends.

    A position on a border belongs to the subinterval on its right, the last one to the last.
    Alpha is rounded half up, as Matlab does for the paper.
    """
    along = np.clip(position / max(extent - 1, 1), 0, 1).astype(np.float64) * parts
    left = np.minimum(along.astype(np.intp), parts - 1)
    to_right = 1 - (along - left)
    return Splits(left, np.floor(dimensions * to_right + 0.5).astype(np.intp))
