# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Image positions as hypervectors (paper, Sec. 3.1.5)."""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.core import hdc
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

    def show(self, basis: hdc.Hypervector, block: slice) -> hdc.Hypervector:
        """
        Return what positions show in a block of dimensions (Eq. 2), (..., t) float32.

        Most of them show one basis vector throughout a short block; only those that change to
        the right one within it are looked at dimension by dimension.
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
    position shows the left basis vector of its subinterval up to dimension alpha, and the right
    one from there on: near positions share most of their dimensions, also across borders.

    :param dimensions: d, length of the vectors.
    :param n_x: horizontal subintervals, hence n_x + 1 basis vectors.
    :param n_y: vertical subintervals.
    :param seed: of the basis vectors.
    """

    def __init__(self, *, dimensions: int, n_x: int, n_y: int, seed: int) -> None:
        self.dimensions, self.n_x, self.n_y = dimensions, n_x, n_y
        self.basis_x = hdc.random_vectors(n_x + 1, dimensions, np.random.default_rng([seed, 0]))
        self.basis_y = hdc.random_vectors(n_y + 1, dimensions, np.random.default_rng([seed, 1]))

    def encode(self, keypoints: NDArray[np.float32], width: int, height: int) -> hdc.Hypervector:
        """
        Return the vectors P of positions.

        :param keypoints: (k, 2) pixels, x right and y down, 0 at the first pixel's centre.
        :return: (k, d) float32 of -1 and 1.
        """
        return hdc.bind(
            self.encode_x(keypoints[:, 0], width), self.encode_y(keypoints[:, 1], height)
        )

    def encode_x(self, x: NDArray[np.float32], width: int) -> hdc.Hypervector:
        """Return the vectors X of (...) horizontal positions in pixels, as (..., d) float32."""
        return self.splits_x(x, width).show(self.basis_x, slice(0, self.dimensions))

    def encode_y(self, y: NDArray[np.float32], height: int) -> hdc.Hypervector:
        """Return the vectors Y of (...) vertical positions in pixels, as (..., d) float32."""
        return self.splits_y(y, height).show(self.basis_y, slice(0, self.dimensions))

    def nodes(self, block: slice) -> hdc.Hypervector:
        """Return all pairs of basis vectors, bound, in a block: (n_x + 1)(n_y + 1), y fastest."""
        pairs = hdc.bind(self.basis_x[:, None, block], self.basis_y[None, :, block])
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
