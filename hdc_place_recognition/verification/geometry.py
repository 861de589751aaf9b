# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Geometric verification: whether the keypoints of two images can be views of one scene."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
from hdc_place_recognition.features.compact import CompactKeypoints, KEYPOINT_WIDTH
from hdc_place_recognition.verification.settings import VerificationSettings
import numpy as np
from numpy.typing import NDArray

Matches = NDArray[np.intp]
_CELLS = 4


@dataclass(frozen=True)
class Geometry:
    """
    What the keypoints of two images have in common; all zero where there is nothing.

    :param votes: matches that agree with one similarity transform.
    :param inliers: matches that agree with one fundamental matrix.
    :param spread: cells of a 4 x 4 grid with inliers, in the image that has fewer.
    :param shift_x: how far to the right the points lie in the keyframe, share of the width.
    :param shift_y: how far down, share of the height.
    :param pairs: (inliers, 2, 2) float32, the points of the inliers in the query and in the
        keyframe, in widths of the image.
    """

    votes: int = 0
    inliers: int = 0
    spread: int = 0
    shift_x: float = 0.0
    shift_y: float = 0.0
    pairs: NDArray[np.float32] = field(
        default_factory=lambda: np.empty((0, 2, 2), np.float32), compare=False
    )

    @property
    def strength(self) -> float:
        """Return the geometric mean of votes and inliers."""
        return float(np.sqrt(self.votes * self.inliers))


def verify_geometry(
    query: CompactKeypoints, keyframe: CompactKeypoints, settings: VerificationSettings
) -> Geometry:
    """Return the geometry of two images; deterministic."""
    matches = match(query.descriptors, keyframe.descriptors, settings.ratio)
    if len(matches) < settings.least_votes:
        return Geometry()
    first, second = matches.T
    pairs = np.stack([query.points[first], keyframe.points[second]], axis=1)
    transforms = keyframe.frames[second] / query.frames[first]
    agreeing = _similarity_votes(pairs, transforms, settings.vote_tolerance)
    moves = keyframe.positions[second] - query.positions[first].astype(np.float64)
    shift_x, shift_y = (np.median(moves[agreeing], axis=0) / np.iinfo(np.uint16).max).tolist()
    inliers = _epipolar_inliers(pairs, settings)
    spreads = [
        _spread(query.positions[first[inliers]]),
        _spread(keyframe.positions[second[inliers]]),
    ]
    return Geometry(
        votes=int(agreeing.sum()),
        inliers=int(np.count_nonzero(inliers)),
        spread=min(spreads),
        shift_x=shift_x,
        shift_y=shift_y,
        pairs=pairs[inliers],
    )


def match(query: NDArray[np.uint8], keyframe: NDArray[np.uint8], ratio: float) -> Matches:
    """
    Return the mutually nearest descriptors that pass the ratio test.

    :param query: (k, m) uint8.
    :param keyframe: (l, m) uint8.
    :param ratio: a match is nearer than this share of the distance to the second nearest.
    :return: (n, 2) indices into both.
    """
    if min(len(query), len(keyframe)) < 2:
        return np.empty((0, 2), np.intp)
    # Sums of products of bytes are exact in float32: no order of summation changes a match.
    a, b = query.astype(np.float32), keyframe.astype(np.float32)
    squared = a @ (-2 * b).T
    squared += np.square(a).sum(axis=1)[:, None]
    squared += np.square(b).sum(axis=1)
    rows, nearest = np.arange(len(a)), squared.argmin(axis=1)
    first, mutual = squared[rows, nearest], squared.argmin(axis=0)[nearest] == rows
    squared[rows, nearest] = np.inf
    passed = np.flatnonzero(mutual & (first < ratio**2 * squared.min(axis=1)))
    return np.stack([passed, nearest[passed]], axis=1)


def _similarity_votes(
    pairs: NDArray[np.float32], transforms: NDArray[np.complex64], tolerance: float
) -> NDArray[np.bool_]:
    """
    Return which matches agree with the similarity transform that most of them agree with.

    Each match proposes a transform by its own size and orientation, so nothing is sampled.
    """
    points, targets = _complex(pairs[:, 0]), _complex(pairs[:, 1])
    moved = transforms * (points[:, None] - points)
    agree = np.abs(targets[:, None] - targets - moved) < tolerance
    return np.asarray(agree[:, agree.sum(axis=0).argmax()])


def _epipolar_inliers(
    pairs: NDArray[np.float32], settings: VerificationSettings
) -> NDArray[np.bool_]:
    """Return which matched points agree with one fundamental matrix; none without one."""
    none = np.zeros(len(pairs), np.bool_)
    if len(pairs) < settings.least_epipolar:
        return none
    try:
        _, mask = cv2.findFundamentalMat(
            pairs[:, 0] * KEYPOINT_WIDTH,
            pairs[:, 1] * KEYPOINT_WIDTH,
            cv2.USAC_MAGSAC,
            settings.epipolar_pixels,
            settings.confidence,
            settings.iterations,
        )
    except cv2.error:  # raised for degenerate points by some versions
        return none
    return none if mask is None else np.asarray(mask).ravel().astype(np.bool_)


def _spread(positions: NDArray[np.uint16]) -> int:
    """Return how many cells of a 4 x 4 grid hold a point."""
    cells = positions.astype(np.int64) * _CELLS // (np.iinfo(np.uint16).max + 1)
    return int(np.count_nonzero(np.bincount(cells @ [1, _CELLS])))


def _complex(points: NDArray[np.float32]) -> NDArray[np.complex64]:
    return points[:, 0] + np.complex64(1j) * points[:, 1]
