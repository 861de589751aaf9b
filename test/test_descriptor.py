# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Eq. 4: the folded form against the plain one, and what the descriptor promises."""

from hdc_place_recognition.core import hdc
from hdc_place_recognition.core.descriptor import (
    center,
    DescriptorEncoder,
    gaussian_projection,
    projected_deviation,
)
from hdc_place_recognition.core.features import LocalFeatures
from hdc_place_recognition.core.folding import bundle_bound, bundle_bound_plain
from hdc_place_recognition.core.positions import PositionEncoder
import numpy as np
import pytest


def encoder(preprocessing: str = 'l2_center', seed: int = 0) -> DescriptorEncoder:
    return DescriptorEncoder(dimensions=4096, n_x=4, n_y=6, preprocessing=preprocessing, seed=seed)


def features(count: int, size: int = 32, seed: int = 0) -> LocalFeatures:
    rng = np.random.default_rng(seed)
    keypoints = rng.uniform((0, 0), (319, 239), (count, 2)).astype(np.float32)
    return LocalFeatures(
        keypoints, rng.standard_normal((count, size)).astype(np.float32), 320, 240
    )


@pytest.mark.parametrize('count', [0, 1, 2, 300])
@pytest.mark.parametrize('dimensions', [1000, 4096])
@pytest.mark.parametrize('grid', [(4, 6), (1, 1), (7, 2)])
def test_folded_equals_plain(count, dimensions, grid):
    positions = PositionEncoder(dimensions=dimensions, n_x=grid[0], n_y=grid[1], seed=1)
    found = features(count)
    arguments = (
        found.descriptors,
        gaussian_projection(dimensions, 32, 0),
        positions,
        found.keypoints,
        found.width,
        found.height,
    )
    plain = bundle_bound_plain(*arguments)
    assert np.allclose(bundle_bound(*arguments), plain, atol=1e-5 * max(1, np.abs(plain).max()))


def test_equation_4_in_a_loop_of_float64():
    one = encoder()
    found = features(20)
    unit = found.descriptors / np.linalg.norm(found.descriptors, axis=1, keepdims=True)
    local = (unit - unit.mean(axis=0)).astype(np.float64)
    places = one.positions.encode(found.keypoints, 320, 240)
    total = np.zeros(4096)
    for descriptor, place in zip(local, places, strict=True):
        total += (one.projection(32) @ descriptor) * place
    assert np.allclose(one.encode(found), total / np.linalg.norm(total), atol=1e-5)


def test_standardize_in_a_loop_of_float64():
    one = encoder('standardize')
    found = features(20)
    unit = found.descriptors / np.linalg.norm(found.descriptors, axis=1, keepdims=True)
    projected = unit.astype(np.float64) @ one.projection(32).T
    standard = (projected - projected.mean(axis=0)) / projected.std(axis=0)
    total = (standard * one.positions.encode(found.keypoints, 320, 240)).sum(axis=0)
    assert np.allclose(one.encode(found), total / np.linalg.norm(total), atol=1e-5)


def test_deviation_from_covariance():
    local = center(features(30).descriptors)
    projection = gaussian_projection(64, 32, 0)
    assert np.allclose(
        projected_deviation(local, projection), (local @ projection.T).std(axis=0), rtol=1e-4
    )


def test_projection_keeps_lengths_on_average():
    unit = hdc.normalize(features(200, size=112).descriptors)
    lengths = np.linalg.norm(unit @ gaussian_projection(4096, 112, 0).T, axis=1)
    assert lengths.mean() == pytest.approx(1, abs=0.02) and lengths.std() < 0.05


def test_unit_length_and_repeatable():
    found = features(50)
    vector = encoder().encode(found)
    assert vector.dtype == np.float32 and np.linalg.norm(vector) == pytest.approx(1)
    assert np.array_equal(vector, encoder().encode(found))
    assert not np.allclose(vector, encoder(seed=1).encode(found))


def test_same_features_elsewhere_are_another_place():
    found = features(100)
    noise = np.random.default_rng(5).normal(0, 0.2, found.descriptors.shape)
    noisy = (found.descriptors + noise).astype(np.float32)
    again = LocalFeatures(found.keypoints, noisy, 320, 240)
    moved = LocalFeatures(found.keypoints[::-1].copy(), found.descriptors, 320, 240)
    one = encoder()
    assert hdc.cosine_similarity(one.encode(found), one.encode(again)) > 0.8
    assert hdc.cosine_similarity(one.encode(found), one.encode(moved)) < 0.3


@pytest.mark.parametrize('preprocessing', ['l2_center', 'standardize'])
def test_defined_answers(preprocessing):
    one = encoder(preprocessing)
    none = one.encode(features(0))
    assert none.shape == (4096,) and not none.any()
    single = one.encode(features(1))
    assert np.isfinite(single).all() and np.linalg.norm(single) == pytest.approx(1, abs=1e-5)
    flat = LocalFeatures(np.zeros((5, 2), np.float32), np.ones((5, 8), np.float32), 10, 10)
    assert not one.encode(flat).any()
    zero = LocalFeatures(np.zeros((3, 2), np.float32), np.zeros((3, 8), np.float32), 10, 10)
    assert not one.encode(zero).any()


def test_inputs_are_left_alone():
    found = features(10)
    before = found.descriptors.copy()
    encoder('standardize').encode(found)
    assert np.array_equal(found.descriptors, before)
