# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The image descriptor: local features bound to roles and bundled (paper, Sec. 3.2.2, Eq. 4)."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Protocol

from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.hdc import algebra
from hdc_place_recognition.hdc.algebra import Hypervector, MAP, VSA
from hdc_place_recognition.hdc.fast_bundling import (
    bundle_folded,
    bundle_grid,
    bundle_shifted,
    GridPlan,
    plan_grid,
)
from hdc_place_recognition.hdc.position import PositionEncoder
from hdc_place_recognition.hdc.projection import PREPROCESSING, PROJECTIONS
from hdc_place_recognition.hdc.shifts import NO_SHIFTS, Shifts
import numpy as np
from numpy.typing import NDArray

# Lengths of centered unit vectors below this are rounding errors.
_ROUNDING = 1e-5


class RoleEncoder(Protocol):
    """Turns what is known of each local feature, such as its position, into a hypervector."""

    def encode(self, features: LocalFeatures) -> Hypervector:
        """Return (k, d) float32, the role vector of each feature."""


def bundle_bound(
    local: NDArray[np.float32],
    projection: NDArray[np.float32],
    roles: Hypervector,
    vsa: VSA = MAP,
) -> Hypervector:
    """
    Return the image descriptor L = sum of L_i * P_i, as Eq. 4 reads.

    >>> local = np.array([[1, 0], [0, 1]], np.float32)
    >>> projection = np.array([[1, 2], [3, 4]], np.float32)
    >>> bundle_bound(local, projection, np.array([[1, -1], [1, 1]], np.float32)).tolist()
    [3.0, 1.0]

    :param local: (k, m) float32, preprocessed descriptors f_i; L_i = W f_i.
    :param projection: W, (d, m) float32.
    :param roles: (k, d) float32, the vectors P_i.
    :param vsa: the architecture.
    :return: (d,) float32.
    """
    return vsa.bundle(vsa.bind(vsa.embed(local @ projection.T), roles))


class DescriptorEncoder:
    """
    Encodes the local features of an image as one hypervector for each shift.

    Where the paper leaves a choice: descriptors are preprocessed before the projection rather than
    after it. Both are equal up to the distortion of the projection, and only the first can be
    computed in a fast form.

    :param dimensions: d, length of the hypervectors.
    :param n_x: horizontal subintervals of the position encoding.
    :param n_y: vertical subintervals.
    :param preprocessing: 'l2_center' (first version of the paper) or 'standardize' (camera-ready).
    :param projection: 'gaussian' or 'orthogonal'.
    :param shifts: under which the image is encoded.
    :param seed: of the random vectors.
    :param vsa: the architecture; the fast forms of Eq. 4 exist for :data:`MAP` only.
    :param roles: of the features; their positions by default.
    :raises PlaceRecognitionError: a count of shifts is even.
    """

    def __init__(
        self,
        *,
        dimensions: int,
        n_x: int,
        n_y: int,
        preprocessing: str,
        projection: str,
        seed: int,
        shifts: Shifts = NO_SHIFTS,
        vsa: VSA = MAP,
        roles: RoleEncoder | None = None,
    ) -> None:
        self.dimensions, self.shifts = dimensions, shifts
        self.positions = PositionEncoder(
            dimensions=dimensions, n_x=n_x, n_y=n_y, seed=seed, vsa=vsa
        )
        self._vsa, self._roles = vsa, roles or self.positions
        self._preprocess = PREPROCESSING[preprocessing]
        project = PROJECTIONS[projection]
        self.projection = cache(lambda size: project(dimensions, size, seed))
        self._planned: tuple[bytes, GridPlan | None] = (b'', None)

    def encode(self, features: LocalFeatures) -> Hypervector:
        """
        Return the image descriptor (Eq. 4) under each shift.

        :return: (s, d) float32 of unit length; zeros if there are no features, or if all of them
            are equal.
        """
        local = self._preprocess(algebra.normalize(features.descriptors))
        if np.linalg.norm(local) <= _ROUNDING:
            return np.zeros((len(self.shifts.offsets), self.dimensions), np.float32)
        return algebra.normalize(self._bundle(local, features))

    def _bundle(self, local: NDArray[np.float32], features: LocalFeatures) -> Hypervector:
        """Return (s, d) bundles, not normalized, in the cheapest form."""
        projection = self.projection(local.shape[1])
        if self._vsa is not MAP or self._roles is not self.positions:
            return self._bundle_readable(local, projection, features)
        if len(self.shifts.offsets) == 1:
            return bundle_folded(local, projection, self.positions, features)[None]
        plan = self._plan(features)
        if plan is not None:
            return bundle_grid(local, projection, plan)
        return bundle_shifted(local, projection, self.positions, features, self.shifts)

    def _bundle_readable(
        self, local: NDArray[np.float32], projection: NDArray[np.float32], features: LocalFeatures
    ) -> Hypervector:
        """Return (s, d) bundles by Eq. 4 as it reads: for any architecture and any roles."""
        extent = np.array([features.width, features.height], np.float32)
        shifted = (
            replace(features, keypoints=features.keypoints + offset * extent)
            for offset in self.shifts.offsets
        )
        roles = map(self._roles.encode, shifted)
        return np.stack([bundle_bound(local, projection, role, self._vsa) for role in roles])

    def _plan(self, features: LocalFeatures) -> GridPlan | None:
        """Return the plan for a regular grid; the last one is kept, since grids rarely change."""
        size = np.array([features.width, features.height])
        key = features.keypoints.tobytes() + size.tobytes()
        if self._planned[0] != key:
            self._planned = key, plan_grid(self.positions, features, self.shifts)
        return self._planned[1]
