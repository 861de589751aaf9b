# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""From descriptors to hypervectors (paper, Sec. 3.1.4): normalization and random projection."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Deviations of unit vectors below this are rounding errors.
_ROUNDING = 1e-5


def gaussian(dimensions: int, size: int, seed: int) -> NDArray[np.float32]:
    """
    Return a Gaussian random projection of descriptors to hypervectors (Sec. 3.1.4).

    :param dimensions: d, length of the hypervectors.
    :param size: m, length of the descriptors.
    :return: (d, m) float32, elements of variance 1 / d, which keeps lengths on average.
    """
    rng = np.random.default_rng([seed, 3, size])
    matrix = rng.standard_normal((dimensions, size), np.float32)
    return matrix / np.float32(np.sqrt(dimensions))


def orthogonal(dimensions: int, size: int, seed: int) -> NDArray[np.float32]:
    """
    Return a random projection that keeps lengths and angles exactly if m <= d.

    It is the Gaussian projection with orthonormal columns (orthonormal rows if m > d).

    :return: (d, m) float32.
    """
    matrix = gaussian(dimensions, size, seed)
    if size > dimensions:
        return np.ascontiguousarray(np.linalg.qr(matrix.T)[0].T)
    return np.ascontiguousarray(np.linalg.qr(matrix)[0])


def center(local: NDArray[np.float32]) -> NDArray[np.float32]:
    """
    Subtract the mean descriptor of the image (Sec. 3.1.4); a single descriptor is kept as it is.

    :param local: (k, m) float32.
    """
    return local - local.mean(axis=0) if len(local) > 1 else local


def standardize(local: NDArray[np.float32]) -> NDArray[np.float32]:
    """
    Center, and scale each dimension to unit deviation in the image (camera-ready paper).

    A dimension without variation becomes 0; a single descriptor is kept as it is.

    :param local: (k, m) float32.
    """
    centered = center(local)
    if len(local) < 2:
        return centered
    deviation = np.sqrt(np.square(centered).mean(axis=0))
    return centered / np.where(deviation > _ROUNDING, deviation, np.float32(np.inf))


PROJECTIONS = {'gaussian': gaussian, 'orthogonal': orthogonal}
PREPROCESSING = {'l2_center': center, 'standardize': standardize}
