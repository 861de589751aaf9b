# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Geometric verification: whether the keypoints of two images can be views of one scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import cv2
from hdc_place_recognition.features.compact import CompactKeypoints, KEYPOINT_WIDTH
from hdc_place_recognition.verification.guided_matching import guided_matches
from hdc_place_recognition.verification.static_content import STILL
import numpy as np
from numpy.typing import NDArray

Matches = NDArray[np.intp]
Mask = NDArray[np.bool_]

# A match is nearer than this share of the distance to the second nearest (D. Lowe's ratio test).
_RATIO = 0.8
# Distance, in widths, within which a match agrees with a similarity transform; large, since a
# similarity transform can not follow parallax.
_VOTE_TOLERANCE = 0.06
_LEAST_FOR_VOTES = 4
# With fewer votes no candidate was ever accepted; a fundamental matrix needs 8 matches.
_LEAST_VOTES, _LEAST_FOR_EPIPOLES = 6, 8
# Of MAGSAC++, pixels of an image of KEYPOINT_WIDTH.
_EPIPOLAR_PIXELS = 1.5
_CONFIDENCE, _ITERATIONS = 0.999, 1000
_CELLS = 4


@dataclass(frozen=True)
class Geometry:
    """
    What the keypoints of two images have in common; all zero where there is nothing.

    :param inliers: matches of the ratio test that agree with one fundamental matrix and with one
        similarity transform; either of them alone accepts degenerate sets.
    :param guided: matches found again where the similarity transform says.
    :param spread: cells of a 4 x 4 grid with inliers, in the image that has fewer.
    :param shift_x: how far to the right the points lie in the keyframe, share of the width.
    :param shift_y: how far down, share of the height.
    :param pairs: (n, 2, 2) float32, points in the query and in the keyframe of all matches that
        agree with the fundamental matrix, in widths of the image.
    """

    inliers: int = 0
    guided: int = 0
    spread: int = 0
    shift_x: float = 0.0
    shift_y: float = 0.0
    pairs: NDArray[np.float32] = field(
        default_factory=lambda: np.empty((0, 2, 2), np.float32), compare=False
    )

    @cached_property
    def strength(self) -> float:
        """Return the inliers that count: the geometric mean of both, and no less than inliers."""
        return float(np.sqrt(self.inliers * max(self.inliers, self.guided)))


@dataclass(frozen=True)
class _MatchedPoints:
    """
    Matches of the ratio test.

    :param first: (n,) indices of the query's keypoints.
    :param second: (n,) indices of the keyframe's keypoints.
    :param pairs: (n, 2, 2) float32, their points, in widths of the image.
    :param voting: (n,) which agree with one similarity transform.
    :param epipolar: (n,) which agree with one fundamental matrix.
    :param descriptors: (k, m) and (l, m), of the query and of the keyframe.
    """

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    pairs: NDArray[np.float32]
    voting: Mask
    epipolar: Mask
    descriptors: tuple[NDArray[np.float32], NDArray[np.float32]]

    @property
    def still(self) -> Mask:
        """Return which stay at their pixels."""
        return _still(self.pairs)


def _nothing_static(points: NDArray[np.float32]) -> bool:
    """Return that matches that stay at their pixels show the same place."""
    del points
    return False


def verify_geometry(
    query: CompactKeypoints,
    keyframe: CompactKeypoints,
    static: Mask | None = None,
    is_static: Callable[[NDArray[np.float32]], bool] = _nothing_static,
) -> Geometry:
    """
    Return the geometry of two images; deterministic.

    :param static: (k,) which keypoints of the query are static content; by default none.
    :param is_static: called with the points (n, 2) of the query, if more than half of the inliers
        stay at their pixels; returns whether they are static content.
    """
    matched = _match_points(query, keyframe)
    if matched is None:
        return Geometry()
    static = np.zeros(len(query), np.bool_) if static is None else static
    counted = ~(matched.still & static[matched.first])
    inliers = matched.epipolar & counted
    caption = _mostly(matched.still, inliers) and is_static(matched.pairs[matched.epipolar, 0])
    if caption:
        counted &= ~matched.still
        inliers &= counted
    agreeing = inliers & matched.voting
    guided = np.empty((0, 2), np.intp) if caption else _guided(query, keyframe, matched, static)
    if len(guided) < np.count_nonzero(agreeing):
        guided, first, second = guided[:0], matched.first[inliers], matched.second[inliers]
    else:
        first, second = guided.T
    shift_x, shift_y = _shift(query, keyframe, matched)
    return Geometry(
        inliers=int(np.count_nonzero(agreeing)),
        guided=len(guided),
        spread=min(_spread(query.positions[first]), _spread(keyframe.positions[second])),
        shift_x=shift_x,
        shift_y=shift_y,
        pairs=matched.pairs[inliers],
    )


def _match_points(query: CompactKeypoints, keyframe: CompactKeypoints) -> _MatchedPoints | None:
    """Return the matches of two images and what agrees with them; None if there are too few."""
    descriptors = query.descriptors, keyframe.descriptors
    matches = match(*descriptors)
    if len(matches) < _LEAST_FOR_VOTES:
        return None
    first, second = matches.T
    pairs = np.stack([query.points[first], keyframe.points[second]], axis=1)
    voting = _similarity_votes(pairs, keyframe.frames[second] / query.frames[first])
    return _MatchedPoints(
        first, second, pairs, voting, _epipolar_inliers(pairs, voting), descriptors
    )


def _guided(
    query: CompactKeypoints, keyframe: CompactKeypoints, matched: _MatchedPoints, static: Mask
) -> Matches:
    """Return the guided matches (n, 2) that are not static content."""
    voting = np.stack([matched.first, matched.second], axis=1)[matched.voting]
    guided = guided_matches(query, keyframe, voting, matched.descriptors)
    pairs = np.stack([query.points[guided[:, 0]], keyframe.points[guided[:, 1]]], axis=1)
    return guided[~(_still(pairs) & static[guided[:, 0]])]


def _mostly(still: Mask, inliers: Mask) -> bool:
    """Return whether more than half of the inliers stay at their pixels."""
    count = int(np.count_nonzero(inliers & still))
    return count >= _LEAST_FOR_VOTES and 2 * count > int(np.count_nonzero(inliers))


def _still(pairs: NDArray[np.float32]) -> Mask:
    """Return (n,) which pairs of points stay at their pixels."""
    moves = pairs[:, 1] - pairs[:, 0]
    return np.asarray(np.hypot(moves[:, 0], moves[:, 1]) < STILL)


def _shift(
    query: CompactKeypoints, keyframe: CompactKeypoints, matched: _MatchedPoints
) -> tuple[float, float]:
    """Return the median move of the voting matches, shares of width and height."""
    moves = keyframe.positions[matched.second] - query.positions[matched.first].astype(np.float64)
    x, y = np.median(moves[matched.voting], axis=0) / np.iinfo(np.uint16).max
    return float(x), float(y)


def match(a: NDArray[np.float32], b: NDArray[np.float32]) -> Matches:
    """
    Return the mutually nearest descriptors that pass the ratio test.

    :param a: (k, m) float32 whole numbers, of the query.
    :param b: (l, m) float32 whole numbers, of the keyframe.
    :return: (n, 2) indices into both.
    """
    if min(len(a), len(b)) < 2:
        return np.empty((0, 2), np.intp)
    # Sums of products of small whole numbers are exact: no order of summation changes a match.
    squared = a @ (-2 * b).T
    squared += np.square(a).sum(axis=1)[:, None]
    squared += np.square(b).sum(axis=1)
    rows, nearest = np.arange(len(a)), squared.argmin(axis=1)
    first, mutual = squared[rows, nearest], squared.argmin(axis=0)[nearest] == rows
    squared[rows, nearest] = np.inf
    passed = np.flatnonzero(mutual & (first < _RATIO**2 * squared.min(axis=1)))
    return np.stack([passed, nearest[passed]], axis=1)


def _similarity_votes(
    pairs: NDArray[np.float32], transforms: NDArray[np.complex64]
) -> NDArray[np.bool_]:
    """
    Return which matches agree with the similarity transform that most of them agree with.

    Each match proposes a transform by its own size and orientation, so nothing is sampled.
    """
    points, targets = _complex(pairs[:, 0]), _complex(pairs[:, 1])
    moved = transforms * (points[:, None] - points)
    agree = np.abs(targets[:, None] - targets - moved) < _VOTE_TOLERANCE
    return np.asarray(agree[:, agree.sum(axis=0).argmax()])


def _epipolar_inliers(pairs: NDArray[np.float32], voting: Mask) -> Mask:
    """Return which matched points agree with one fundamental matrix; none without one."""
    if len(pairs) < _LEAST_FOR_EPIPOLES or np.count_nonzero(voting) < _LEAST_VOTES:
        return np.zeros(len(pairs), np.bool_)
    found = _fundamental_inliers(pairs, cv2.USAC_MAGSAC)
    return found if found.any() else _fundamental_inliers(pairs, cv2.FM_RANSAC)


def _fundamental_inliers(pairs: NDArray[np.float32], method: int) -> Mask:
    """
    Return the inliers of a fundamental matrix; none if OpenCV finds no matrix.

    MAGSAC finds none, or raises an error, if the image has only shifted; RANSAC does.
    """
    try:
        _, mask = cv2.findFundamentalMat(
            pairs[:, 0] * KEYPOINT_WIDTH,
            pairs[:, 1] * KEYPOINT_WIDTH,
            method,
            _EPIPOLAR_PIXELS,
            _CONFIDENCE,
            _ITERATIONS,
        )
    except cv2.error:
        mask = None
    if mask is None:
        return np.zeros(len(pairs), np.bool_)
    return np.asarray(mask).ravel().astype(np.bool_)


def _spread(positions: NDArray[np.uint16]) -> int:
    """Return how many cells of a 4 x 4 grid hold a point."""
    cells = positions.astype(np.int64) * _CELLS // (np.iinfo(np.uint16).max + 1)
    return int(np.count_nonzero(np.bincount(cells @ [1, _CELLS])))


def _complex(points: NDArray[np.float32]) -> NDArray[np.complex64]:
    return points[:, 0] + np.complex64(1j) * points[:, 1]
