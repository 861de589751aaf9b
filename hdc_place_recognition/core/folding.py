# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Eq. 4 of the paper, in the readable form and in the fast one.

Binding acts on single dimensions, and in one dimension a position shows only one of the
(n_x + 1)(n_y + 1) pairs of basis vectors: a node of the grid. So the features of a node can be
summed before they are projected, L[t] = W[t] . sum_i P_i[t] f_i, and the number of features
hardly matters. A feature changes its node only at the dimensions alpha_x and alpha_y; within a
block of dimensions most stay where they are.
"""

from __future__ import annotations

from hdc_place_recognition.core import hdc
from hdc_place_recognition.core.positions import PositionEncoder, Splits
import numpy as np
from numpy.typing import NDArray

_BLOCK = 128


def bundle_bound_plain(
    local: NDArray[np.float32],
    projection: NDArray[np.float32],
    positions: PositionEncoder,
    keypoints: NDArray[np.float32],
    width: int,
    height: int,
) -> hdc.Hypervector:
    """
    Return sum of (W f_i) * P_i, written as in Eq. 4; the reference for :func:`bundle_bound`.

    :param local: (k, m) float32, preprocessed descriptors f_i.
    :param projection: W, (d, m) float32.
    :param keypoints: (k, 2) float32, pixels.
    :return: (d,) float32.
    """
    projected = local @ projection.T
    return hdc.bundle(hdc.bind(projected, positions.encode(keypoints, width, height)))


def bundle_bound(
    local: NDArray[np.float32],
    projection: NDArray[np.float32],
    positions: PositionEncoder,
    keypoints: NDArray[np.float32],
    width: int,
    height: int,
) -> hdc.Hypervector:
    """Return the same as :func:`bundle_bound_plain`, summing first and projecting once."""
    splits = (
        positions.splits_x(keypoints[:, 0], width),
        positions.splits_y(keypoints[:, 1], height),
    )
    bundled = np.empty(positions.dimensions, np.float32)
    every = np.arange(positions.dimensions)
    for start in range(0, positions.dimensions, _BLOCK):
        block = slice(start, start + _BLOCK)
        bundled[block] = _bundle_block(local, projection[block], positions, splits, every[block])
    return bundled


def _bundle_block(
    local: NDArray[np.float32],
    projection: NDArray[np.float32],
    positions: PositionEncoder,
    splits: tuple[Splits, Splits],
    block: NDArray[np.intp],
) -> hdc.Hypervector:
    """Return some dimensions of the bundle: those who stay are summed, the others projected."""
    ends_x, ends_y = (split.basis_index(block[[0, -1]]) for split in splits)
    first, last = (ends_x * (positions.n_y + 1) + ends_y).T
    stays = first == last
    count = (positions.n_x + 1) * (positions.n_y + 1)
    member = (np.arange(count)[:, None] == np.where(stays, first, -1)).astype(np.float32)
    signs = hdc.bind(positions.basis_x[:, None, block], positions.basis_y[None, :, block])
    summed = hdc.bind((member @ local) @ projection.T, signs.reshape(count, -1))
    moving = np.flatnonzero(~stays)
    vectors = hdc.bind(
        *(
            basis[Splits(split.left[moving], split.alpha[moving]).basis_index(block), block]
            for basis, split in zip((positions.basis_x, positions.basis_y), splits, strict=True)
        )
    )
    return hdc.bundle(summed) + hdc.bundle(hdc.bind(local[moving] @ projection.T, vectors))
