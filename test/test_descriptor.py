# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Eq. 4: the fast forms against the plain one, and what the descriptor promises."""

from __future__ import annotations

from hdc_place_recognition.core import hdc
from hdc_place_recognition.core.descriptor import DescriptorEncoder, gaussian, orthogonal
from hdc_place_recognition.core.displacements import (
    bundle_displaced,
    bundle_grid,
    Displacements,
    plan_grid,
)
from hdc_place_recognition.core.folding import bundle_bound, bundle_bound_plain
from hdc_place_recognition.core.positions import PositionEncoder
from hdc_place_recognition.features.types import LocalFeatures
import numpy as np
from numpy.typing import NDArray
import pytest

ONE = Displacements(1, 1, 0.0)


def encoder(
    preprocessing: str = 'l2_center', seed: int = 0, displacements: Displacements = ONE
) -> DescriptorEncoder:
    return DescriptorEncoder(
        dimensions=4096,
        n_x=4,
        n_y=6,
        preprocessing=preprocessing,
        projection='gaussian',
        displacements=displacements,
        seed=seed,
    )


def features(count: int, size: int = 32, seed: int = 0) -> LocalFeatures:
    rng = np.random.default_rng(seed)
    keypoints = rng.uniform((0, 0), (319, 239), (count, 2)).astype(np.float32)
    descriptors = rng.standard_normal((count, size)).astype(np.float32)
    return LocalFeatures(keypoints, descriptors, 320, 240)


def grid_of_features(columns: int = 20, rows: int = 15, size: int = 32) -> LocalFeatures:
    x, y = np.meshgrid(np.arange(columns) * 16 + 7.5, np.arange(rows) * 16 + 7.5)
    keypoints = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)
    return LocalFeatures(keypoints, features(rows * columns, size).descriptors, 320, 240)


def close(a: NDArray[np.float32], b: NDArray[np.float32]) -> bool:
    return np.allclose(a, b, atol=1e-5 * max(1.0, float(np.abs(b).max())))


@pytest.mark.parametrize('count', [0, 1, 2, 300])
@pytest.mark.parametrize('dimensions', [1000, 4096])
@pytest.mark.parametrize('subintervals', [(4, 6), (1, 1), (7, 2)])
def test_folded_equals_plain(count, dimensions, subintervals):
    n_x, n_y = subintervals
    positions = PositionEncoder(dimensions=dimensions, n_x=n_x, n_y=n_y, seed=1)
    found = features(count)
    arguments = (
        found.descriptors,
        gaussian(dimensions, 32, 0),
        positions,
        found.keypoints,
        found.width,
        found.height,
    )
    assert close(bundle_bound(*arguments), bundle_bound_plain(*arguments))


def test_folded_equals_plain_where_features_move_at_once_or_not_at_all():
    # Corners, nodes, places that repeat, and x and y at the same share: alpha_x = alpha_y.
    positions = PositionEncoder(dimensions=1000, n_x=4, n_y=4, seed=1)
    along = np.linspace(-5, 105, 45, dtype=np.float32)
    corners = np.array([[0, 0], [100, 100], [25, 50], [25, 50], [100, 0]], np.float32)
    keypoints = np.concatenate([np.stack([along, along], axis=1), corners])
    arguments = features(len(keypoints)).descriptors, gaussian(1000, 32, 0), positions, keypoints
    plain = bundle_bound_plain(*arguments, 101, 101)
    assert close(bundle_bound(*arguments, 101, 101), plain)


def test_folding_piles_up_no_rounding_errors():
    # The sums of the nodes are changed 2000 times on the way; float64 says what is right.
    positions = PositionEncoder(dimensions=4096, n_x=8, n_y=6, seed=1)
    found, projection = features(1000), gaussian(4096, 32, 0)
    places = positions.encode(found.keypoints, 320, 240).astype(np.float64)
    exact = ((found.descriptors @ projection.T.astype(np.float64)) * places).sum(axis=0)
    folded = bundle_bound(found.descriptors, projection, positions, found.keypoints, 320, 240)
    assert np.abs(folded - exact).max() < 1e-5 * np.abs(exact).max()


@pytest.mark.parametrize('count', [1, 2, 300])
@pytest.mark.parametrize('dimensions', [1000, 4096])
@pytest.mark.parametrize('counts', [(5, 3), (1, 3), (1, 1)])
def test_displaced_equals_plain_under_every_displacement(count, dimensions, counts):
    positions = PositionEncoder(dimensions=dimensions, n_x=8, n_y=6, seed=1)
    projection, found = gaussian(dimensions, 32, 0), features(count)
    displacements = Displacements(*counts, 0.1)
    bundled = bundle_displaced(
        found.descriptors, projection, positions, found.keypoints, 320, 240, displacements
    )
    assert bundled.shape == (counts[0] * counts[1], dimensions) and bundled.dtype == np.float32
    for vector, (dx, dy) in zip(bundled, displacements.offsets, strict=True):
        moved = found.keypoints + np.array([dx * 320, dy * 240], np.float32)
        plain = bundle_bound_plain(found.descriptors, projection, positions, moved, 320, 240)
        assert close(vector, plain)


@pytest.mark.parametrize('shape', [(20, 15), (1, 15), (20, 1), (1, 1)])
def test_grid_equals_plain_under_every_displacement(shape):
    positions = PositionEncoder(dimensions=1000, n_x=4, n_y=6, seed=1)
    projection, found = gaussian(1000, 32, 0), grid_of_features(*shape)
    displacements = Displacements(5, 3, 0.1)
    plan = plan_grid(positions, found.keypoints, 320, 240, displacements)
    assert plan is not None
    bundled = bundle_grid(found.descriptors, projection, plan)
    assert bundled.shape == (15, 1000) and bundled.dtype == np.float32
    for vector, (dx, dy) in zip(bundled, displacements.offsets, strict=True):
        moved = found.keypoints + np.array([dx * 320, dy * 240], np.float32)
        plain = bundle_bound_plain(found.descriptors, projection, positions, moved, 320, 240)
        assert close(vector, plain)


def test_what_is_no_grid_is_seen():
    positions = PositionEncoder(dimensions=64, n_x=2, n_y=2, seed=0)
    grid = grid_of_features(4, 3).keypoints
    moved = grid.copy()
    moved[5, 0] += 0.5
    for keypoints in (moved, grid[:-1], grid[::-1], features(12).keypoints):
        found = plan_grid(positions, keypoints, 320, 240, ONE)
        # The grid backwards is a grid too.
        assert (found is not None) == np.array_equal(keypoints, grid[::-1])


def test_displacements_are_regular_round_none():
    found = Displacements(3, 5, 0.1)
    assert found.x.tolist() == pytest.approx([-0.1, 0, 0.1])
    assert found.offsets.shape == (15, 2)
    assert found.offsets[found.none].tolist() == [0, 0]
    assert found.offsets[found.none + 1].tolist() == pytest.approx([0.1, 0])


def test_equation_4_in_a_loop_of_float64():
    one, found = encoder(), features(20)
    unit = found.descriptors / np.linalg.norm(found.descriptors, axis=1, keepdims=True)
    local = (unit - unit.mean(axis=0)).astype(np.float64)
    places = one.positions.encode(found.keypoints, 320, 240)
    total = np.zeros(4096)
    for descriptor, place in zip(local, places, strict=True):
        total += (one.projection(32) @ descriptor) * place
    assert np.allclose(one.encode(found)[0], total / np.linalg.norm(total), atol=1e-5)


def test_standardize_in_a_loop_of_float64():
    one, found = encoder('standardize'), features(20)
    unit = found.descriptors / np.linalg.norm(found.descriptors, axis=1, keepdims=True)
    local = (unit - unit.mean(axis=0)) / unit.astype(np.float64).std(axis=0)
    projected = local @ one.projection(32).T
    total = (projected * one.positions.encode(found.keypoints, 320, 240)).sum(axis=0)
    assert np.allclose(one.encode(found)[0], total / np.linalg.norm(total), atol=1e-5)


def test_gaussian_projection_keeps_lengths_on_average():
    unit = hdc.normalize(features(200, size=112).descriptors)
    lengths = np.linalg.norm(unit @ gaussian(4096, 112, 0).T, axis=1)
    assert lengths.mean() == pytest.approx(1, abs=0.02) and lengths.std() < 0.05


def test_orthogonal_projection_keeps_lengths_and_angles():
    unit = hdc.normalize(features(50, size=112).descriptors)
    projected = unit @ orthogonal(4096, 112, 0).T
    assert np.allclose(projected @ projected.T, unit @ unit.T, atol=1e-5)
    wide = orthogonal(64, 112, 0)
    assert wide.shape == (64, 112) and np.allclose(wide @ wide.T, np.eye(64), atol=1e-5)


@pytest.mark.parametrize('found', [features(50), grid_of_features()])
def test_unit_length_and_repeatable(found):
    vectors = encoder(displacements=Displacements(3, 3, 0.1)).encode(found)
    assert vectors.shape == (9, 4096) and vectors.dtype == np.float32
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1, atol=1e-5)
    again = encoder(displacements=Displacements(3, 3, 0.1))
    assert np.array_equal(vectors, again.encode(found))
    assert np.allclose(vectors[4], encoder().encode(found)[0], atol=1e-6)
    assert not np.allclose(vectors[4], encoder(seed=1).encode(found)[0])


def test_same_features_elsewhere_are_another_place():
    found = features(100)
    noise = np.random.default_rng(5).normal(0, 0.2, found.descriptors.shape)
    noisy = (found.descriptors + noise).astype(np.float32)
    again = LocalFeatures(found.keypoints, noisy, 320, 240)
    moved = LocalFeatures(found.keypoints[::-1].copy(), found.descriptors, 320, 240)
    one = encoder()
    assert hdc.cosine_similarity(one.encode(found), one.encode(again)) > 0.8
    assert hdc.cosine_similarity(one.encode(found), one.encode(moved)) < 0.3


def test_displacement_makes_up_for_a_shifted_view():
    one = encoder(displacements=Displacements(5, 1, 0.1))
    found = features(100)
    # The view moved by 64 px: what was at x is now at x - 64, and what left it is replaced.
    left = found.keypoints[:, 0] < 64
    keypoints = found.keypoints - np.array([64, 0], np.float32)
    keypoints[left] += np.array([320, 0], np.float32)
    descriptors = np.where(left[:, None], features(100, seed=9).descriptors, found.descriptors)
    query = one.encode(LocalFeatures(keypoints, descriptors, 320, 240))
    similarities = hdc.cosine_similarity(query, one.encode(found)[2])
    assert similarities.argmax() == 4 and similarities[4] > 2 * similarities[2]


@pytest.mark.parametrize('preprocessing', ['l2_center', 'standardize'])
def test_defined_answers(preprocessing):
    one = encoder(preprocessing)
    none = one.encode(features(0))
    assert none.shape == (1, 4096) and not none.any()
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
