# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Fast forms of Eq. 4 for MAP with real elements; each equals the readable form to 1e-5.

- :func:`bundle_folded`: features anywhere in the image, no shifts. Features are summed first and
  projected once.
- :func:`bundle_grid`: features on a regular grid, all shifts at once.
- :func:`bundle_shifted`: features anywhere, all shifts at once.

Why folding works: projecting and binding are linear, so L[t] = sum of (W f_i)[t] P_i[t]
= W[t] . s(t) with s(t) = sum of P_i[t] f_i. In one dimension t a position shows only one of the
(n_x + 1)(n_y + 1) pairs of basis vectors (Eq. 2), a node of the grid of borders. So s(t) is the
signed sum of the features on each node, whatever their number. As t grows, a feature changes its
node twice: at alpha_x to the node on the right, at alpha_y to the node below.
"""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.hdc import algebra
from hdc_place_recognition.hdc.algebra import Hypervector
from hdc_place_recognition.hdc.position import PositionEncoder
from hdc_place_recognition.hdc.shifts import Shifts
import numpy as np
from numpy.typing import NDArray


def bundle_folded(
    local: NDArray[np.float32],
    projection: NDArray[np.float32],
    positions: PositionEncoder,
    features: LocalFeatures,
) -> Hypervector:
    """
    Return sum of (W f_i) * P_i (Eq. 4), summing features first and projecting once.

    In a block of dimensions each move adds to s(t), from its dimension on, the feature times the
    difference of the two nodes; after the block the sums of both nodes are updated.

    :param local: (k, m) float32, preprocessed descriptors f_i.
    :param projection: W, (d, m) float32.
    :param features: whose positions are bound.
    :return: (d,) float32.
    """
    moves = _moves(positions, features)
    every_node = np.arange((positions.n_x + 1) * (positions.n_y + 1))
    sums = _members(every_node, moves.begin) @ local
    bundled = np.empty(positions.dimensions, np.float32)
    for block in algebra.blocks(positions.dimensions):
        now = slice(*np.searchsorted(moves.at, (block.start, block.stop)))
        old, new, moved = moves.old[now], moves.new[now], local[moves.feature[now]]
        nodes = positions.nodes(block)
        change = nodes[new] - nodes[old]
        change *= np.arange(block.start, block.stop) >= moves.at[now, None]
        summed = nodes.T @ sums + change.T @ moved
        np.einsum('tm,tm->t', projection[block], summed, out=bundled[block])
        sums += (_members(every_node, new) - _members(every_node, old)) @ moved
    return bundled


def _members(every_node: NDArray[np.intp], nodes: NDArray[np.intp]) -> NDArray[np.float32]:
    """Return the matrix that sums the features of each node."""
    return np.equal.outer(every_node, nodes).astype(np.float32)


@dataclass(frozen=True)
class _Moves:
    """
    The node of each feature, as (n_y + 1) x + y, and its moves in the order of dimensions.

    :param begin: (k,) node before any move.
    :param at: (2 k,) first dimension on the new node, ascending; d for moves that never happen.
    :param feature: (2 k,) the feature that moves.
    :param old: (2 k,) node before the move.
    :param new: (2 k,) node after the move.
    """

    begin: NDArray[np.intp]
    at: NDArray[np.intp]
    feature: NDArray[np.intp]
    old: NDArray[np.intp]
    new: NDArray[np.intp]


def _moves(positions: PositionEncoder, features: LocalFeatures) -> _Moves:
    """Return the moves of all features along both axes."""
    x = positions.splits_x(features.keypoints[:, 0], features.width)
    y = positions.splits_y(features.keypoints[:, 1], features.height)
    right, down = positions.n_y + 1, 1
    begin = x.left * right + y.left
    x_first = x.alpha < y.alpha
    at = np.concatenate([x.alpha, y.alpha])
    old = np.concatenate([begin + down * ~x_first, begin + right * x_first])
    new = old + np.repeat([right, down], len(begin))
    feature = np.tile(np.arange(len(begin)), 2)
    order = np.argsort(at, kind='stable')
    return _Moves(begin, at[order], feature[order], old[order], new[order])


@dataclass(frozen=True)
class GridPlan:
    """
    The role vectors of a regular grid of features, which are the same for every image.

    :param x: (d, columns, count_x) float32, vectors X of the shifted columns.
    :param y: (d, count_y, rows) float32, vectors Y of the shifted rows.
    """

    x: Hypervector
    y: Hypervector


def plan_grid(
    positions: PositionEncoder, features: LocalFeatures, shifts: Shifts
) -> GridPlan | None:
    """Return the plan for features that are a regular grid, row by row; None if they are not."""
    shape = features.grid_shape
    if shape is None:
        return None
    columns = shape[1]
    x, y = features.keypoints[:columns, 0], features.keypoints[::columns, 1]
    vectors_x = positions.encode_x(shifts.shift_x(x, features.width), features.width)
    vectors_y = positions.encode_y(shifts.shift_y(y, features.height), features.height)
    return GridPlan(
        np.ascontiguousarray(vectors_x.transpose(2, 1, 0)),
        np.ascontiguousarray(vectors_y.transpose(2, 0, 1)),
    )


def bundle_grid(
    local: NDArray[np.float32], projection: NDArray[np.float32], plan: GridPlan
) -> Hypervector:
    """
    Return sum of (W f_i) * P_i (Eq. 4) under every shift, for features on a grid.

    P = X * Y; the features of a row share Y, those of a column share X. The sums over rows and
    columns are therefore two small matrix products in each dimension.

    :param local: (rows * columns, m) float32, preprocessed descriptors f_i.
    :param projection: W, (d, m) float32.
    :return: (count_y * count_x, d) float32.
    """
    dimensions, columns, count_x = plan.x.shape
    count = plan.y.shape[1] * count_x
    bundled = np.empty((count, dimensions), np.float32)
    for block in algebra.blocks(dimensions):
        projected = (projection[block] @ local.T).reshape(-1, plan.y.shape[2], columns)
        bundled[:, block] = (plan.y[block] @ projected @ plan.x[block]).reshape(-1, count).T
    return bundled


def bundle_shifted(
    local: NDArray[np.float32],
    projection: NDArray[np.float32],
    positions: PositionEncoder,
    features: LocalFeatures,
    shifts: Shifts,
) -> Hypervector:
    """
    Return sum of (W f_i) * P_i (Eq. 4) under every shift, for features anywhere.

    P = X * Y; X depends on the horizontal shift only, Y on the vertical one. A feature is
    therefore projected once and bound to count_x vectors X before it is bound to count_y vectors
    Y.

    :param local: (k, m) float32, preprocessed descriptors f_i.
    :param projection: W, (d, m) float32.
    :param features: whose positions are bound.
    :return: (count_y * count_x, d) float32.
    """
    keypoints, width, height = features.keypoints, features.width, features.height
    x = positions.splits_x(shifts.shift_x(keypoints[:, 0], width), width)
    y = positions.splits_y(shifts.shift_y(keypoints[:, 1], height), height)
    bundled = np.empty((len(y.left), len(x.left), positions.dimensions), np.float32)
    for block in algebra.blocks(positions.dimensions):
        bound = algebra.bind(x.show(positions.basis_x, block), local @ projection[block].T)
        vectors_y = y.show(positions.basis_y, block)
        np.einsum('yit,xit->yxt', vectors_y, bound, out=bundled[..., block])
    return bundled.reshape(-1, positions.dimensions)
