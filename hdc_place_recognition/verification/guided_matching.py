# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Matches guided by the geometry found.

The ratio test loses most true matches of repeated structure and of images of low resolution. Once
some matches agree with one similarity transform, each keypoint is searched for again where that
transform maps it, at the size and orientation that it predicts, and without ratio test.
"""

from __future__ import annotations

from hdc_place_recognition.features.compact import CompactKeypoints
import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex64]
Descriptors = tuple[NDArray[np.float32], NDArray[np.float32]]

_LEAST_AGREEING = 4
# Around the predicted point, in widths of the image; half the tolerance of the votes.
_RADIUS = 0.03
_OCTAVES, _ANGLE = 0.6, np.deg2rad(25)
# Largest distance of two descriptors of unit length. At .75 and .85 look-alike floors and gardens
# gained more wrong matches than true ones.
_DISTANCE = 0.65
_SMALLEST_SCALE, _LARGEST_SCALE = 0.2, 5.0


def guided_matches(
    query: CompactKeypoints,
    keyframe: CompactKeypoints,
    agreeing: NDArray[np.intp],
    descriptors: Descriptors,
) -> NDArray[np.intp]:
    """
    Return the mutually nearest descriptors among keypoints that the transform maps together.

    :param agreeing: (n, 2), matches that agree with one similarity transform.
    :param descriptors: (k, m) and (l, m), of the query and of the keyframe.
    :return: (m, 2), indices of both.
    """
    none = np.empty((0, 2), np.intp)
    if len(agreeing) < _LEAST_AGREEING:
        return none
    points, targets = _complex(query.points), _complex(keyframe.points)
    scale, shift = _similarity_transform(points[agreeing[:, 0]], targets[agreeing[:, 1]])
    if not _SMALLEST_SCALE < abs(scale) < _LARGEST_SCALE:
        return none
    predicted = (scale * points + shift).astype(np.complex64)
    first, second = np.nonzero(np.abs(targets - predicted[:, None]) < _RADIUS)
    change = keyframe.frames[second] / query.frames[first] / scale
    fits = (np.abs(np.log2(np.abs(change))) < _OCTAVES) & (np.abs(np.angle(change)) < _ANGLE)
    return _mutually_nearest(*descriptors, first[fits], second[fits], query.unit * _DISTANCE)


def _similarity_transform(points: Complex, targets: Complex) -> tuple[complex, complex]:
    """
    Return a and b of least squares |a z + b - w|^2 over matched points z and w, (n,) complex.

    :return: a is scale and roll, b the shift; a = 0 where all points are one.
    """
    middle, target_middle = points.mean(), targets.mean()
    moved = points - middle
    size = np.square(np.abs(moved)).sum()
    if size == 0:
        return 0j, complex(target_middle)
    scale = ((targets - target_middle) * np.conj(moved)).sum() / size
    return complex(scale), complex(target_middle - scale * middle)


def _mutually_nearest(
    descriptors: NDArray[np.float32],
    target_descriptors: NDArray[np.float32],
    first: NDArray[np.intp],
    second: NDArray[np.intp],
    limit: float,
) -> NDArray[np.intp]:
    """Return the pairs (n, 2) nearer than the limit of which neither has a nearer partner."""
    difference = descriptors[first] - target_descriptors[second]
    distance = np.sqrt(np.einsum('ij,ij->i', difference, difference))
    near = distance < limit
    first, second, distance = first[near], second[near], distance[near]
    least = np.full(len(descriptors), np.inf)
    target_least = np.full(len(target_descriptors), np.inf)
    np.minimum.at(least, first, distance)
    np.minimum.at(target_least, second, distance)
    mutual = (distance == least[first]) & (distance == target_least[second])
    return np.stack([first[mutual], second[mutual]], axis=1)


def _complex(points: NDArray[np.float32]) -> Complex:
    return points[:, 0] + np.complex64(1j) * points[:, 1]
