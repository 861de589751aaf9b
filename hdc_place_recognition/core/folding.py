# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Eq. 4 of the paper, in the readable form and in the fast one.

Projecting and binding are linear, so features can be summed before they are projected:
L[t] = sum of (W f_i)[t] P_i[t] = W[t] . s(t) with s(t) = sum of P_i[t] f_i. In one dimension t a
position shows only one of the (n_x + 1)(n_y + 1) pairs of basis vectors (Eq. 2), a node of the
grid, so s(t) is the signed sum of what sits on the nodes, however many features there are. As t
grows, a feature moves but twice: at alpha_x to the node on its right, at alpha_y to the one below.
"""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.core import hdc
from hdc_place_recognition.core.positions import PositionEncoder
import numpy as np
from numpy.typing import NDArray


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
    """
    Return the same as :func:`bundle_bound_plain`, summing first and projecting once.

    In a block of dimensions, each move adds to s(t), from its dimension on, the feature times the
    difference of the two nodes; after the block, the sums of both nodes take it over.
    """
    moves = _moves(positions, keypoints, width, height)
    every_node = np.arange((positions.n_x + 1) * (positions.n_y + 1))
    sums = _members(every_node, moves.begin) @ local
    bundled = np.empty(positions.dimensions, np.float32)
    for block in hdc.blocks(positions.dimensions):
        now = slice(*np.searchsorted(moves.at, (block.start, block.stop)))
        old, new, moved = moves.old[now], moves.new[now], local[moves.feature[now]]
        nodes = positions.nodes(block)
        turned = nodes[new] - nodes[old]
        turned *= np.arange(block.start, block.stop) >= moves.at[now, None]
        summed = nodes.T @ sums + turned.T @ moved
        np.einsum('tm,tm->t', projection[block], summed, out=bundled[block])
        sums += (_members(every_node, new) - _members(every_node, old)) @ moved
    return bundled


def _members(every_node: NDArray[np.intp], nodes: NDArray[np.intp]) -> NDArray[np.float32]:
    """Return the matrix that sums on each node what sits there."""
    return np.equal.outer(every_node, nodes).astype(np.float32)


@dataclass(frozen=True)
class _Moves:
    """
    Which node each feature sits on, as (n_y + 1) x + y, and where it moves, in order.

    :param begin: (k,) node before any move.
    :param at: (2 k,) first dimension on the new node, ascending; d for moves that never happen.
    :param feature: (2 k,) which one moves.
    :param old: (2 k,) node that it leaves.
    :param new: (2 k,) node that it enters.
    """

    begin: NDArray[np.intp]
    at: NDArray[np.intp]
    feature: NDArray[np.intp]
    old: NDArray[np.intp]
    new: NDArray[np.intp]


def _moves(
    positions: PositionEncoder, keypoints: NDArray[np.float32], width: int, height: int
) -> _Moves:
    """Return the moves of features along x and along y, whichever comes first."""
    x = positions.splits_x(keypoints[:, 0], width)
    y = positions.splits_y(keypoints[:, 1], height)
    right, down = positions.n_y + 1, 1
    begin = x.left * right + y.left
    x_first = x.alpha < y.alpha
    at = np.concatenate([x.alpha, y.alpha])
    old = np.concatenate([begin + down * ~x_first, begin + right * x_first])
    new = old + np.repeat([right, down], len(begin))
    feature = np.tile(np.arange(len(begin)), 2)
    order = np.argsort(at, kind='stable')
    return _Moves(begin, at[order], feature[order], old[order], new[order])
