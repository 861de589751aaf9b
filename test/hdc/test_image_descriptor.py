# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Eq. 4: the fast forms against the plain one, and what the descriptor promises."""

from __future__ import annotations

from dataclasses import replace

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.hdc import algebra
from hdc_place_recognition.hdc.fast_bundling import (
    bundle_folded,
    bundle_grid,
    bundle_shifted,
    plan_grid,
)
from hdc_place_recognition.hdc.image_descriptor import bundle_bound, DescriptorEncoder
from hdc_place_recognition.hdc.position import PositionEncoder
from hdc_place_recognition.hdc.projection import gaussian, orthogonal
from hdc_place_recognition.hdc.shifts import Shifts
import numpy as np
from numpy.typing import NDArray
import pytest

ONE = Shifts(1, 1, 0.0)


def new_encoder(
    preprocessing: str = 'l2_center', seed: int = 0, shifts: Shifts = ONE
) -> DescriptorEncoder:
    return DescriptorEncoder(
        dimensions=4096,
        n_x=4,
        n_y=6,
        preprocessing=preprocessing,
        projection='gaussian',
        shifts=shifts,
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


def equation_4(
    found: LocalFeatures,
    projection: NDArray[np.float32],
    positions: PositionEncoder,
    offset: tuple[float, float] = (0, 0),
) -> NDArray[np.float32]:
    """Return the bundle as Eq. 4 reads, of features moved by shares of width and height."""
    moved = found.keypoints + np.array(offset, np.float32) * (found.width, found.height)
    roles = positions.encode(replace(found, keypoints=moved.astype(np.float32)))
    return bundle_bound(found.descriptors, projection, roles)


def close(a: NDArray[np.float32], b: NDArray[np.float32]) -> bool:
    return np.allclose(a, b, atol=1e-5 * max(1.0, float(np.abs(b).max())))


@pytest.mark.parametrize('count', [0, 1, 2, 300])
@pytest.mark.parametrize('dimensions', [1000, 4096])
@pytest.mark.parametrize('subintervals', [(4, 6), (1, 1), (7, 2)])
def test_folded_equals_equation_4(count, dimensions, subintervals):
    n_x, n_y = subintervals
    positions = PositionEncoder(dimensions=dimensions, n_x=n_x, n_y=n_y, seed=1)
    found, projection = features(count), gaussian(dimensions, 32, 0)
    folded = bundle_folded(found.descriptors, projection, positions, found)
    assert close(folded, equation_4(found, projection, positions))


def test_folded_equals_equation_4_where_features_move_at_once_or_not_at_all():
    # Corners, nodes, places that repeat, and x and y at the same share: alpha_x = alpha_y.
    positions = PositionEncoder(dimensions=1000, n_x=4, n_y=4, seed=1)
    along = np.linspace(-5, 105, 45, dtype=np.float32)
    corners = np.array([[0, 0], [100, 100], [25, 50], [25, 50], [100, 0]], np.float32)
    keypoints = np.concatenate([np.stack([along, along], axis=1), corners])
    found = LocalFeatures(keypoints, features(len(keypoints)).descriptors, 101, 101)
    projection = gaussian(1000, 32, 0)
    folded = bundle_folded(found.descriptors, projection, positions, found)
    assert close(folded, equation_4(found, projection, positions))


def test_folding_piles_up_no_rounding_errors():
    # The sums of the nodes are changed 2000 times on the way; float64 says what is right.
    positions = PositionEncoder(dimensions=4096, n_x=8, n_y=6, seed=1)
    found, projection = features(1000), gaussian(4096, 32, 0)
    places = positions.encode(found).astype(np.float64)
    exact = ((found.descriptors @ projection.T.astype(np.float64)) * places).sum(axis=0)
    folded = bundle_folded(found.descriptors, projection, positions, found)
    assert np.abs(folded - exact).max() < 1e-5 * np.abs(exact).max()


@pytest.mark.parametrize('count', [1, 2, 300])
@pytest.mark.parametrize('dimensions', [1000, 4096])
@pytest.mark.parametrize('counts', [(5, 3), (1, 3), (1, 1)])
def test_shifted_equals_equation_4_under_every_shift(count, dimensions, counts):
    positions = PositionEncoder(dimensions=dimensions, n_x=8, n_y=6, seed=1)
    projection, found = gaussian(dimensions, 32, 0), features(count)
    shifts = Shifts(*counts, 0.1)
    bundled = bundle_shifted(found.descriptors, projection, positions, found, shifts)
    assert bundled.shape == (counts[0] * counts[1], dimensions) and bundled.dtype == np.float32
    for vector, offset in zip(bundled, shifts.offsets, strict=True):
        assert close(vector, equation_4(found, projection, positions, offset))


@pytest.mark.parametrize('shape', [(20, 15), (1, 15), (20, 1), (1, 1)])
def test_grid_equals_equation_4_under_every_shift(shape):
    positions = PositionEncoder(dimensions=1000, n_x=4, n_y=6, seed=1)
    projection, found = gaussian(1000, 32, 0), grid_of_features(*shape)
    shifts = Shifts(5, 3, 0.1)
    plan = plan_grid(positions, found, shifts)
    assert plan is not None
    bundled = bundle_grid(found.descriptors, projection, plan)
    assert bundled.shape == (15, 1000) and bundled.dtype == np.float32
    for vector, offset in zip(bundled, shifts.offsets, strict=True):
        assert close(vector, equation_4(found, projection, positions, offset))


def test_what_is_no_grid_is_seen():
    positions = PositionEncoder(dimensions=64, n_x=2, n_y=2, seed=0)
    grid = grid_of_features(4, 3).keypoints
    moved = grid.copy()
    moved[5, 0] += 0.5
    for keypoints in (moved, grid[:-1], grid[::-1], features(12).keypoints):
        blank = np.zeros((len(keypoints), 1), np.float32)
        found = plan_grid(positions, LocalFeatures(keypoints, blank, 320, 240), ONE)
        # The grid backwards is a grid too.
        assert (found is not None) == np.array_equal(keypoints, grid[::-1])


def test_shifts_are_regular_around_zero():
    found = Shifts(3, 5, 0.1)
    assert found.x.tolist() == pytest.approx([-0.1, 0, 0.1])
    assert found.offsets.shape == (15, 2)
    assert found.offsets[found.zero].tolist() == [0, 0]
    assert found.offsets[found.zero + 1].tolist() == pytest.approx([0.1, 0])


def test_equation_4_in_a_loop_of_float64():
    encoder, found = new_encoder(), features(20)
    unit = found.descriptors / np.linalg.norm(found.descriptors, axis=1, keepdims=True)
    local = (unit - unit.mean(axis=0)).astype(np.float64)
    places = encoder.positions.encode(found)
    total = np.zeros(4096)
    for descriptor, place in zip(local, places, strict=True):
        total += (encoder.projection(32) @ descriptor) * place
    assert np.allclose(encoder.encode(found)[0], total / np.linalg.norm(total), atol=1e-5)


def test_standardize_in_a_loop_of_float64():
    encoder, found = new_encoder('standardize'), features(20)
    unit = found.descriptors / np.linalg.norm(found.descriptors, axis=1, keepdims=True)
    local = (unit - unit.mean(axis=0)) / unit.astype(np.float64).std(axis=0)
    projected = local @ encoder.projection(32).T
    total = (projected * encoder.positions.encode(found)).sum(axis=0)
    assert np.allclose(encoder.encode(found)[0], total / np.linalg.norm(total), atol=1e-5)


def test_gaussian_projection_keeps_lengths_on_average():
    unit = algebra.normalize(features(200, size=112).descriptors)
    lengths = np.linalg.norm(unit @ gaussian(4096, 112, 0).T, axis=1)
    assert lengths.mean() == pytest.approx(1, abs=0.02) and lengths.std() < 0.05


def test_orthogonal_projection_keeps_lengths_and_angles():
    unit = algebra.normalize(features(50, size=112).descriptors)
    projected = unit @ orthogonal(4096, 112, 0).T
    assert np.allclose(projected @ projected.T, unit @ unit.T, atol=1e-5)
    wide = orthogonal(64, 112, 0)
    assert wide.shape == (64, 112) and np.allclose(wide @ wide.T, np.eye(64), atol=1e-5)


@pytest.mark.parametrize('found', [features(50), grid_of_features()])
def test_unit_length_and_repeatable(found):
    vectors = new_encoder(shifts=Shifts(3, 3, 0.1)).encode(found)
    assert vectors.shape == (9, 4096) and vectors.dtype == np.float32
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1, atol=1e-5)
    again = new_encoder(shifts=Shifts(3, 3, 0.1))
    assert np.array_equal(vectors, again.encode(found))
    assert np.allclose(vectors[4], new_encoder().encode(found)[0], atol=1e-6)
    assert not np.allclose(vectors[4], new_encoder(seed=1).encode(found)[0])


def test_same_features_elsewhere_are_another_place():
    found = features(100)
    noise = np.random.default_rng(5).normal(0, 0.2, found.descriptors.shape)
    noisy = (found.descriptors + noise).astype(np.float32)
    again = LocalFeatures(found.keypoints, noisy, 320, 240)
    moved = LocalFeatures(found.keypoints[::-1].copy(), found.descriptors, 320, 240)
    encoder = new_encoder()
    assert algebra.cosine_similarity(encoder.encode(found), encoder.encode(again)) > 0.8
    assert algebra.cosine_similarity(encoder.encode(found), encoder.encode(moved)) < 0.3


def test_a_shift_makes_up_for_a_shifted_view():
    encoder = new_encoder(shifts=Shifts(5, 1, 0.1))
    found = features(100)
    # The view moved by 64 px: what was at x is now at x - 64, and what left it is replaced.
    left = found.keypoints[:, 0] < 64
    keypoints = found.keypoints - np.array([64, 0], np.float32)
    keypoints[left] += np.array([320, 0], np.float32)
    descriptors = np.where(left[:, None], features(100, seed=9).descriptors, found.descriptors)
    query = encoder.encode(LocalFeatures(keypoints, descriptors, 320, 240))
    similarities = algebra.cosine_similarity(query, encoder.encode(found)[2])
    assert similarities.argmax() == 4 and similarities[4] > 2 * similarities[2]


@pytest.mark.parametrize('preprocessing', ['l2_center', 'standardize'])
def test_defined_answers(preprocessing):
    encoder = new_encoder(preprocessing)
    none = encoder.encode(features(0))
    assert none.shape == (1, 4096) and not none.any()
    single = encoder.encode(features(1))
    assert np.isfinite(single).all() and np.linalg.norm(single) == pytest.approx(1, abs=1e-5)
    flat = LocalFeatures(np.zeros((5, 2), np.float32), np.ones((5, 8), np.float32), 10, 10)
    assert not encoder.encode(flat).any()
    zero = LocalFeatures(np.zeros((3, 2), np.float32), np.zeros((3, 8), np.float32), 10, 10)
    assert not encoder.encode(zero).any()


def test_inputs_are_left_alone():
    found = features(10)
    before = found.descriptors.copy()
    new_encoder('standardize').encode(found)
    assert np.array_equal(found.descriptors, before)


@pytest.mark.parametrize('counts', [(2, 1), (3, 4)])
def test_an_even_count_of_shifts_is_refused(counts):
    with pytest.raises(PlaceRecognitionError, match=r'count_[xy] [24] is even.*use [13] or [35]'):
        Shifts(*counts, 0.1)


class Bipolar:
    """A toy architecture: signs, bundled by majority."""

    random_vectors = staticmethod(algebra.random_vectors)
    bind = staticmethod(algebra.bind)
    unbind = staticmethod(algebra.unbind)
    permute = staticmethod(algebra.permute)
    similarity = staticmethod(algebra.cosine_similarity)

    def embed(self, projected: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.where(projected >= 0, np.float32(1), np.float32(-1))

    def bundle(self, vectors: NDArray[np.float32]) -> NDArray[np.float32]:
        return self.embed(vectors.sum(axis=0))


def with_vsa(vsa: algebra.VSA, **changes: object) -> DescriptorEncoder:
    settings = {'preprocessing': 'l2_center', 'projection': 'gaussian', 'seed': 0, **changes}
    return DescriptorEncoder(dimensions=4096, n_x=4, n_y=6, vsa=vsa, **settings)


def noisy(found: LocalFeatures, deviation: float = 0.3) -> LocalFeatures:
    noise = np.random.default_rng(5).normal(0, deviation, found.descriptors.shape)
    return replace(found, descriptors=(found.descriptors + noise).astype(np.float32))


def test_another_architecture_encodes_and_compares_images():
    vsa = Bipolar()
    encoder, found = with_vsa(vsa), features(60)
    vector = encoder.encode(found)[0]
    assert np.unique(np.abs(vector)).size == 1
    assert vsa.similarity(vector, encoder.encode(noisy(found))[0]) > 0.4
    assert abs(vsa.similarity(vector, encoder.encode(features(60, seed=1))[0])) < 0.1


def test_another_architecture_is_compared_under_shifts_too():
    found = features(60)
    moved = replace(found, keypoints=found.keypoints + np.array([32, 0], np.float32))
    encoder = with_vsa(Bipolar(), shifts=Shifts(3, 1, 0.1))
    similarities = algebra.cosine_similarity(encoder.encode(moved), encoder.encode(found)[1])
    assert similarities.argmax() == 0 and similarities[0] > 2 * similarities[1]


class OneRole:
    """A toy role encoder: every feature has the same role."""

    def encode(self, found: LocalFeatures) -> NDArray[np.float32]:
        return np.ones((len(found.keypoints), 4096), np.float32)


def test_other_roles_than_positions_are_bound():
    found, encoder = features(50), with_vsa(algebra.MAP, roles=OneRole())
    moved = replace(found, keypoints=found.keypoints[::-1].copy())
    assert np.array_equal(encoder.encode(found), encoder.encode(moved))
    assert encoder.encode(found).any()


def test_the_readable_form_serves_map_as_well():
    found, shifts = features(40), Shifts(3, 3, 0.1)
    fast = new_encoder(shifts=shifts)
    readable = with_vsa(algebra.MAP, shifts=shifts, roles=fast.positions)
    assert close(readable.encode(found), fast.encode(found))
