# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Normalization and random projection of descriptors: by hand."""

from hdc_place_recognition.hdc.projection import center, gaussian, orthogonal, standardize
import numpy as np
import pytest


def array(*rows: tuple[float, ...]) -> np.ndarray:
    return np.array(rows, np.float32)


def test_the_mean_is_subtracted_from_two_descriptors_and_more():
    assert center(array((1, 5), (3, 5))).tolist() == [[-1, 0], [1, 0]]
    assert center(array((1, 5))).tolist() == [[1, 5]]
    assert center(np.empty((0, 2), np.float32)).shape == (0, 2)


def test_each_dimension_has_unit_deviation():
    # Deviation 2 in the first dimension, none in the second, rounding errors in the third.
    found = standardize(array((1, 5, 1), (5, 5, 1 + 1e-6)))
    assert found.tolist() == [[-1, 0, 0], [1, 0, 0]]
    assert standardize(array((1, 5))).tolist() == [[1, 5]]


def test_projection_depends_on_seed_and_size_alone():
    rng = np.random.default_rng([4, 3, 5])
    expected = rng.standard_normal((64, 5), np.float32) / 8
    assert gaussian(64, 5, 4) == pytest.approx(expected)
    assert not np.array_equal(gaussian(64, 5, 4), gaussian(64, 5, 3))


@pytest.mark.parametrize('size', [3, 8])
def test_orthogonal_columns_span_those_of_the_gaussian(size):
    found, original = orthogonal(8, size, 0), gaussian(8, size, 0)
    assert found.shape == (8, size) and found.flags.c_contiguous
    assert np.allclose(found.T @ found, np.eye(size), atol=1e-6)
    assert np.allclose(found @ (found.T @ original), original, atol=1e-6)
