# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Local features and their positions as hypervectors (paper, Sec. 3.1.4 and Eq. 4)."""

from __future__ import annotations

from functools import cache

from hdc_place_recognition.core import hdc
from hdc_place_recognition.core.displacements import (
    bundle_displaced,
    bundle_grid,
    Displacements,
    GridPlan,
    plan_grid,
)
from hdc_place_recognition.core.folding import bundle_bound
from hdc_place_recognition.core.positions import PositionEncoder
from hdc_place_recognition.features.types import LocalFeatures
import numpy as np
from numpy.typing import NDArray

# Lengths below this, of what centring leaves of unit vectors, are rounding errors.
_NOTHING = 1e-5


class DescriptorEncoder:
    """
    Encodes the local features of an image as hypervectors, one for each displacement.

    Where the paper leaves a choice: features are preprocessed before the projection rather than
    after it, which is the same up to the projection's distortion and makes folding possible. The
    projection is orthogonal by default; a Gaussian one is what the paper has.

    :param dimensions: d, length of the hypervectors.
    :param n_x: horizontal subintervals of the position encoding.
    :param n_y: vertical subintervals.
    :param preprocessing: 'l2_center' is the paper's first version, 'standardize' its second.
    :param projection: 'gaussian' or 'orthogonal'.
    :param displacements: under which the image is encoded.
    :param seed: of the random vectors.
    """

    def __init__(
        self,
        *,
        dimensions: int,
        n_x: int,
        n_y: int,
        preprocessing: str,
        projection: str,
        displacements: Displacements,
        seed: int,
    ) -> None:
        self.positions = PositionEncoder(dimensions=dimensions, n_x=n_x, n_y=n_y, seed=seed)
        self.displacements = displacements
        self._preprocess = {'l2_center': center, 'standardize': standardize}[preprocessing]
        project = {'gaussian': gaussian, 'orthogonal': orthogonal}[projection]
        self.projection = cache(lambda size: project(dimensions, size, seed))
        self._planned: tuple[bytes, GridPlan | None] = (b'', None)

    def encode(self, features: LocalFeatures) -> hdc.Hypervector:
        """
        Return the image descriptor L = sum of L_i * P_i (Eq. 4) under each displacement.

        :return: (s, d) float32, unit lengths; zeros if there is no feature, or none that differs
            from the others.
        """
        local = self._preprocess(hdc.normalize(features.descriptors))
        if np.linalg.norm(local) <= _NOTHING:
            shape = len(self.displacements.offsets), self.positions.dimensions
            return np.zeros(shape, np.float32)
        return hdc.normalize(self._bundle(local, features))

    def _bundle(self, local: NDArray[np.float32], features: LocalFeatures) -> hdc.Hypervector:
        """Return the descriptors before they are normalized, in the cheapest of three ways."""
        projection = self.projection(local.shape[1])
        places = self.positions, features.keypoints, features.width, features.height
        if len(self.displacements.offsets) == 1:
            return bundle_bound(local, projection, *places)[None]
        plan = self._plan(features)
        if plan is not None:
            return bundle_grid(local, projection, plan)
        return bundle_displaced(local, projection, *places, self.displacements)

    def _plan(self, features: LocalFeatures) -> GridPlan | None:
        """Return the plan for a regular grid; the last one is kept, grids rarely change."""
        size = features.width, features.height
        key = features.keypoints.tobytes() + np.array(size).tobytes()
        if self._planned[0] != key:
            plan = plan_grid(self.positions, features.keypoints, *size, self.displacements)
            self._planned = key, plan
        return self._planned[1]


def gaussian(dimensions: int, size: int, seed: int) -> NDArray[np.float32]:
    """
    Return a Gaussian random projection of descriptors to hypervectors (Sec. 3.1.4).

    :param size: m, length of the descriptors.
    :return: (d, m) float32, entries of variance 1 / d, so that lengths are kept on average.
    """
    rng = np.random.default_rng([seed, 3, size])
    matrix = rng.standard_normal((dimensions, size), np.float32)
    return matrix / np.float32(np.sqrt(dimensions))


def orthogonal(dimensions: int, size: int, seed: int) -> NDArray[np.float32]:
    """
    Return a random projection that keeps lengths and angles exactly if m <= d.

    The Gaussian one with its columns (its rows, if m > d) made orthonormal.

    :return: (d, m) float32.
    """
    matrix = gaussian(dimensions, size, seed)
    if size > dimensions:
        return np.ascontiguousarray(np.linalg.qr(matrix.T)[0].T)
    return np.ascontiguousarray(np.linalg.qr(matrix)[0])


def center(local: NDArray[np.float32]) -> NDArray[np.float32]:
    """
    Subtract the image's mean descriptor (Sec. 3.1.4); a single feature stays as it is.

    :param local: (k, m) float32.
    """
    return local - local.mean(axis=0) if len(local) > 1 else local


def standardize(local: NDArray[np.float32]) -> NDArray[np.float32]:
    """
    Centre, and scale each dimension to unit deviation in the image (camera-ready paper).

    Dimensions in which the features do not vary become 0; a single feature stays as it is.

    :param local: (k, m) float32.
    """
    centred = center(local)
    if len(local) < 2:
        return centred
    deviation = np.sqrt(np.square(centred).mean(axis=0))
    return centred / np.where(deviation > _NOTHING, deviation, np.float32(np.inf))
