# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Local features and their positions as one hypervector (paper, Sec. 3.1.4 and Eq. 4)."""

from __future__ import annotations

from functools import cache

from hdc_place_recognition.core import hdc
from hdc_place_recognition.core.features import LocalFeatures
from hdc_place_recognition.core.folding import bundle_bound
from hdc_place_recognition.core.positions import PositionEncoder
import numpy as np
from numpy.typing import NDArray

# Lengths below this, of what centring leaves of unit vectors, are rounding errors.
_NOTHING = 1e-5


class DescriptorEncoder:
    """
    Encodes the local features of an image as one hypervector.

    Where the paper leaves a choice: the projection's entries are Gaussian with variance 1 / d;
    features get unit length and are centred before the projection rather than after it, which
    projects to the same up to its distortion of lengths (a few per cent), since the projection is
    linear; it is what makes folding possible.

    :param dimensions: d, length of the hypervectors.
    :param n_x: horizontal subintervals of the position encoding.
    :param n_y: vertical subintervals.
    :param preprocessing: 'l2_center' is the paper's first version, 'standardize' its second.
    :param seed: of the random vectors.
    """

    def __init__(
        self, *, dimensions: int, n_x: int, n_y: int, preprocessing: str, seed: int
    ) -> None:
        self.positions = PositionEncoder(dimensions=dimensions, n_x=n_x, n_y=n_y, seed=seed)
        self._standardize = preprocessing == 'standardize'
        self.projection = cache(lambda size: gaussian_projection(dimensions, size, seed))

    def encode(self, features: LocalFeatures) -> hdc.Hypervector:
        """
        Return the image descriptor L = sum of L_i * P_i (Eq. 4).

        :return: (d,) float32, unit length; zeros if there is no feature, or none that differs
            from the others.
        """
        local = center(hdc.normalize(features.descriptors))
        if np.linalg.norm(local) <= _NOTHING:
            return np.zeros(self.positions.dimensions, np.float32)
        projection = self.projection(local.shape[1])
        bundled = bundle_bound(
            local, projection, self.positions, features.keypoints, features.width, features.height
        )
        if self._standardize:
            bundled = standardize(bundled, projected_deviation(local, projection))
        return hdc.normalize(bundled)


def gaussian_projection(dimensions: int, size: int, seed: int) -> NDArray[np.float32]:
    """
    Return a random projection of descriptors to hypervectors (Sec. 3.1.4).

    :param size: m, length of the descriptors.
    :return: (d, m) float32, Gaussian entries of variance 1 / d, so that lengths are kept on
        average.
    """
    rng = np.random.default_rng([seed, 3, size])
    matrix = rng.standard_normal((dimensions, size), np.float32)
    return matrix / np.float32(np.sqrt(dimensions))


def center(local: NDArray[np.float32]) -> NDArray[np.float32]:
    """
    Subtract the image's mean descriptor (Sec. 3.1.4); a single feature stays as it is.

    :param local: (k, m) float32.
    """
    return local - local.mean(axis=0) if len(local) > 1 else local


def projected_deviation(
    local: NDArray[np.float32], projection: NDArray[np.float32]
) -> NDArray[np.float32]:
    """
    Return the standard deviation of projected features in each dimension.

    From the covariance of the features, so that they need not be projected one by one.

    :param local: (k, m) float32, centred.
    :param projection: (d, m) float32.
    :return: (d,) float32.
    """
    covariance = local.T @ local / np.float32(len(local))
    variance = np.einsum('dm,dm->d', projection @ covariance, projection)
    return np.sqrt(np.maximum(variance, 0))


def standardize(bundled: hdc.Hypervector, deviation: NDArray[np.float32]) -> hdc.Hypervector:
    """
    Scale each dimension to unit deviation of the image's features (camera-ready paper).

    The features are scaled after binding, which is the same: both act on single dimensions.
    Dimensions in which they do not vary are left as they are.
    """
    return np.divide(bundled, deviation, out=bundled.copy(), where=deviation > _NOTHING)
