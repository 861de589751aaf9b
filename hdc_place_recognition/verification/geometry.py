# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether two images can be views of one scene, by the geometry of their keypoints."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
from hdc_place_recognition.features.compact import Landmarks
import numpy as np
from numpy.typing import NDArray

Matches = NDArray[np.intp]

# A match is nearer than this share of the distance to the second nearest (Lowe's ratio test).
_RATIO = 0.8
# Of the width: a similarity stands in for parallax, which it cannot follow.
_VOTE_TOLERANCE = 0.06
_LEAST_FOR_VOTES = 4
_LEAST_FOR_EPIPOLES = 8
# The robust estimator wants pixels: those of an image of this width.
_WIDTH = 320
_EPIPOLAR_PIXELS = 1.5
_CONFIDENCE, _ITERATIONS = 0.999, 1000
_CELLS = 4


@dataclass(frozen=True)
class Geometry:
    """
    What two images have in common; all zero where there is nothing.

    :param votes: matches that agree with one similarity transform.
    :param inliers: matches that agree with one fundamental matrix.
    :param spread: cells of a 4 x 4 grid with inliers, in the image that has fewer.
    :param shift_x: how far to the right the points lie in the earlier image, share of the width.
    :param shift_y: how far down, share of the height.
    :param pairs: (inliers, 2, 2) float32, their points in both images, in widths of the image.
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


def verify(query: Landmarks, earlier: Landmarks) -> Geometry:
    """Return the geometry of two images; the same input gives the same answer, always one."""
    matches = match(query.descriptors, earlier.descriptors)
    if len(matches) < _LEAST_FOR_VOTES:
        return Geometry()
    first, second = matches.T
    pairs = np.stack([query.points[first], earlier.points[second]], axis=1)
    agreeing = _similarity_votes(pairs, earlier.shapes[second] / query.shapes[first])
    moved = (earlier.places[second] - query.places[first].astype(np.float64))[agreeing]
    shift_x, shift_y = (np.median(moved, axis=0) / np.iinfo(np.uint16).max).tolist()
    inliers = _epipolar_inliers(pairs)
    cells = [_spread(query.places[first[inliers]]), _spread(earlier.places[second[inliers]])]
    return Geometry(
        votes=int(agreeing.sum()),
        inliers=int(np.count_nonzero(inliers)),
        spread=min(cells),
        shift_x=shift_x,
        shift_y=shift_y,
        pairs=pairs[inliers],
    )


def match(query: NDArray[np.uint8], earlier: NDArray[np.uint8]) -> Matches:
    """
    Return the mutually nearest descriptors that pass the ratio test.

    :param query: (k, m) uint8.
    :param earlier: (l, m) uint8.
    :return: (n, 2) rows of both.
    """
    if min(len(query), len(earlier)) < 2:
        return np.empty((0, 2), np.intp)
    # Sums of products of bytes are exact in float32: no order of summation changes a match.
    a, b = query.astype(np.float32), earlier.astype(np.float32)
    squared = a @ (-2 * b).T
    squared += np.square(a).sum(axis=1)[:, None]
    squared += np.square(b).sum(axis=1)
    rows, nearest = np.arange(len(a)), squared.argmin(axis=1)
    first, mutual = squared[rows, nearest], squared.argmin(axis=0)[nearest] == rows
    squared[rows, nearest] = np.inf
    passed = np.flatnonzero(mutual & (first < _RATIO**2 * squared.min(axis=1)))
    return np.stack([passed, nearest[passed]], axis=1)


def _similarity_votes(
    pairs: NDArray[np.float32], transform: NDArray[np.complex64]
) -> NDArray[np.bool_]:
    """
    Return which matches agree with the similarity transform that most agree with.

    Every match proposes one by its own size and direction, so that there is nothing to sample.
    """
    points, others = _complex(pairs[:, 0]), _complex(pairs[:, 1])
    moved = transform * (points[:, None] - points)
    agree = np.abs(others[:, None] - others - moved) < _VOTE_TOLERANCE
    return np.asarray(agree[:, agree.sum(axis=0).argmax()])


def _epipolar_inliers(pairs: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return which matched points agree with one fundamental matrix; none without one."""
    none = np.zeros(len(pairs), np.bool_)
    if len(pairs) < _LEAST_FOR_EPIPOLES:
        return none
    try:
        _, mask = cv2.findFundamentalMat(
            pairs[:, 0] * _WIDTH,
            pairs[:, 1] * _WIDTH,
            cv2.USAC_MAGSAC,
            _EPIPOLAR_PIXELS,
            _CONFIDENCE,
            _ITERATIONS,
        )
    except cv2.error:  # of degenerate points, in some versions
        return none
    return none if mask is None else np.asarray(mask).ravel().astype(np.bool_)


def _spread(places: NDArray[np.uint16]) -> int:
    """Return how many cells of a 4 x 4 grid hold a point."""
    cells = places.astype(np.int64) * _CELLS // (np.iinfo(np.uint16).max + 1)
    return int(np.count_nonzero(np.bincount(cells @ [1, _CELLS])))


def _complex(points: NDArray[np.float32]) -> NDArray[np.complex64]:
    return points[:, 0] + np.complex64(1j) * points[:, 1]
