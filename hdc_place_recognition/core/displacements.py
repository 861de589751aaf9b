# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
The same image seen a little to the side: what makes up for a shifted camera.

Binding to positions costs tolerance to shifts of the view. So the query is encoded as if its
features sat elsewhere, under a few displacements, and an earlier image is as similar as under the
best of them. The database keeps one vector an image.
"""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.core import hdc
from hdc_place_recognition.core.positions import PositionEncoder
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Displacements:
    """
    A regular set of displacements round none at all.

    :param count_x: horizontal ones, odd; 1 for none.
    :param count_y: vertical ones, odd.
    :param step: from one to the next, as a share of the image's width or height.
    """

    count_x: int
    count_y: int
    step: float

    @property
    def x(self) -> NDArray[np.float32]:
        """Return (count_x,) horizontal displacements, shares of the width."""
        return _symmetric(self.count_x, self.step)

    @property
    def y(self) -> NDArray[np.float32]:
        """Return (count_y,) vertical displacements, shares of the height."""
        return _symmetric(self.count_y, self.step)

    @property
    def offsets(self) -> NDArray[np.float32]:
        """Return all of them in order, (count_y * count_x, 2) as (x, y); the middle one is 0."""
        x, y = np.meshgrid(self.x, self.y)
        return np.stack([x.ravel(), y.ravel()], axis=1)

    def displace_x(self, x: NDArray[np.float32], width: int) -> NDArray[np.float32]:
        """Return (k,) horizontal positions in pixels under each displacement, (count_x, k)."""
        return np.add.outer(self.x * np.float32(width), x)

    def displace_y(self, y: NDArray[np.float32], height: int) -> NDArray[np.float32]:
        """Return (k,) vertical positions in pixels under each displacement, (count_y, k)."""
        return np.add.outer(self.y * np.float32(height), y)

    @property
    def none(self) -> int:
        """Return the index of the displacement by nothing."""
        return self.count_x * self.count_y // 2

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """
        Return indices of displacements in blocks of 3 x 3 that overlap by one.

        A bundle of a block is about as similar to what any of its parts is similar to.
        """
        index = np.arange(self.count_x * self.count_y).reshape(self.count_y, self.count_x)
        blocks = (
            index[np.ix_(rows, columns)]
            for rows in _overlapping(self.count_y)
            for columns in _overlapping(self.count_x)
        )
        return tuple(tuple(block.ravel().tolist()) for block in blocks)


def _overlapping(count: int) -> list[range]:
    """Return ranges of three that overlap by one, or one of all if there are fewer."""
    return [range(first, min(first + 3, count)) for first in range(0, max(count - 2, 1), 2)]


def _symmetric(count: int, step: float) -> NDArray[np.float32]:
    return ((np.arange(count) - count // 2) * step).astype(np.float32)


@dataclass(frozen=True)
class GridPlan:
    """
    What is known of a regular grid of features before any is seen.

    :param x: (d, columns, count_x) float32, vectors X of the displaced columns.
    :param y: (d, count_y, rows) float32, vectors Y of the displaced rows.
    """

    x: hdc.Hypervector
    y: hdc.Hypervector


def plan_grid(
    positions: PositionEncoder,
    keypoints: NDArray[np.float32],
    width: int,
    height: int,
    displacements: Displacements,
) -> GridPlan | None:
    """
    Return the plan for keypoints that are a regular grid, row by row, or None if they are not.

    :param keypoints: (k, 2) float32, pixels.
    """
    columns = int(np.argmax(keypoints[:, 1] != keypoints[0, 1])) or len(keypoints)
    if len(keypoints) % columns:
        return None
    x, y = keypoints[:columns, 0], keypoints[::columns, 1]
    if not np.array_equal(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), keypoints):
        return None
    vectors_x = positions.encode_x(displacements.displace_x(x, width), width)
    vectors_y = positions.encode_y(displacements.displace_y(y, height), height)
    return GridPlan(
        np.ascontiguousarray(vectors_x.transpose(2, 1, 0)),
        np.ascontiguousarray(vectors_y.transpose(2, 0, 1)),
    )


def bundle_grid(
    local: NDArray[np.float32], projection: NDArray[np.float32], plan: GridPlan
) -> hdc.Hypervector:
    """
    Return sum of (W f_i) * P_i (Eq. 4) under every displacement.

    P = X * Y, and on a grid the features of a row share Y and those of a column share X. So the
    sum over rows and then over columns are, for each dimension, two small matrix products.

    :param local: (rows * columns, m) float32, preprocessed descriptors.
    :param projection: W, (d, m) float32.
    :return: (count_y * count_x, d) float32.
    """
    dimensions, columns, count_x = plan.x.shape
    count = plan.y.shape[1] * count_x
    bundled = np.empty((count, dimensions), np.float32)
    for block in hdc.blocks(dimensions):
        projected = (projection[block] @ local.T).reshape(-1, plan.y.shape[2], columns)
        bundled[:, block] = (plan.y[block] @ projected @ plan.x[block]).reshape(-1, count).T
    return bundled


def bundle_displaced(
    local: NDArray[np.float32],
    projection: NDArray[np.float32],
    positions: PositionEncoder,
    keypoints: NDArray[np.float32],
    width: int,
    height: int,
    displacements: Displacements,
) -> hdc.Hypervector:
    """
    Return sum of (W f_i) * P_i (Eq. 4) under every displacement, for features anywhere.

    P = X * Y, and X only knows the horizontal displacement, Y the vertical one. So a feature is
    projected once, bound to count_x vectors X, and only then meets count_y vectors Y.

    :param local: (k, m) float32, preprocessed descriptors.
    :param projection: W, (d, m) float32.
    :param keypoints: (k, 2) float32, pixels.
    :return: (count_y * count_x, d) float32.
    """
    x = positions.splits_x(displacements.displace_x(keypoints[:, 0], width), width)
    y = positions.splits_y(displacements.displace_y(keypoints[:, 1], height), height)
    bundled = np.empty((len(y.left), len(x.left), positions.dimensions), np.float32)
    for block in hdc.blocks(positions.dimensions):
        bound = hdc.bind(x.show(positions.basis_x, block), local @ projection[block].T)
        vectors_y = y.show(positions.basis_y, block)
        np.einsum('yit,xit->yxt', vectors_y, bound, out=bundled[..., block])
    return bundled.reshape(-1, positions.dimensions)
