# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Eq. 1-2 of the paper."""

from collections.abc import Iterable

from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.hdc import algebra
from hdc_place_recognition.hdc.position import PositionEncoder
from hdc_place_recognition.hdc.sequence import SequenceBundler
import numpy as np
import pytest

ENCODER = PositionEncoder(dimensions=4096, n_x=4, n_y=6, seed=0)


def at(points: Iterable[tuple[float, float]], width: int, height: int) -> LocalFeatures:
    """Return features at some points, in pixels."""
    keypoints = np.array(list(points), np.float32)
    return LocalFeatures(keypoints, np.ones((len(keypoints), 1), np.float32), width, height)


def encode(
    *points: tuple[float, float], width: int = 101, height: int = 61
) -> algebra.Hypervector:
    return ENCODER.encode(at(points, width, height))


def test_split_by_hand():
    # 9 pixels, 2 subintervals of 4: x = 5 lies 1/4 into the second, so alpha = 8 * 3/4 = 6.
    encoder = PositionEncoder(dimensions=8, n_x=2, n_y=1, seed=3)
    splits_x = encoder.splits_x(np.array([5], np.float32), 9)
    splits_y = encoder.splits_y(np.array([0], np.float32), 9)
    assert splits_x.left.tolist() == [1] and splits_x.alpha.tolist() == [6]
    assert splits_y.left.tolist() == [0] and splits_y.alpha.tolist() == [8]
    x = np.concatenate([encoder.basis_x[1, :6], encoder.basis_x[2, 6:]])
    expected = x * encoder.basis_y[0]
    assert np.array_equal(encoder.encode(at([(5, 0)], 9, 9))[0], expected)


@pytest.mark.parametrize('size', [1, 7, 8, 100])
def test_blocks_show_what_equation_2_says(size):
    encoder = PositionEncoder(dimensions=30, n_x=3, n_y=2, seed=0)
    splits = encoder.splits_x(np.linspace(-1, 101, 60, dtype=np.float32).reshape(3, 20), 101)
    assert {0, 30} <= set(splits.alpha.ravel())
    blocks = list(algebra.blocks(30, size))
    shown = np.concatenate([splits.show(encoder.basis_x, block) for block in blocks], axis=-1)
    on_the_left = np.arange(30) < splits.alpha[..., None]
    left, right = encoder.basis_x[splits.left], encoder.basis_x[splits.left + 1]
    assert np.array_equal(shown, np.where(on_the_left, left, right))


def test_nodes_are_bound_pairs():
    encoder = PositionEncoder(dimensions=30, n_x=3, n_y=2, seed=0)
    nodes = encoder.nodes(slice(10, 20))
    assert nodes.shape == (4 * 3, 10)
    assert np.array_equal(nodes[1 * 3 + 2], (encoder.basis_x[1] * encoder.basis_y[2])[10:20])


def test_alpha_is_rounded_half_up():
    # x = 1 of 16 steps: to the right remain 15/16 of 8 dimensions = 7.5, rounded to 8.
    encoder = PositionEncoder(dimensions=8, n_x=1, n_y=1, seed=0)
    splits_x = encoder.splits_x(np.array([1, 3], np.float32), 17)
    assert splits_x.alpha.tolist() == [8, 7]  # 3 of 16: 6.5 -> 7; banker's rounding gives 6


def test_corners_and_borders_show_basis_vectors():
    first, last, border = encode((0, 0), (100, 60), (25, 10))
    assert np.array_equal(first, ENCODER.basis_x[0] * ENCODER.basis_y[0])
    assert np.array_equal(last, ENCODER.basis_x[4] * ENCODER.basis_y[6])
    assert np.array_equal(border, ENCODER.basis_x[1] * ENCODER.basis_y[1])


def test_entries_are_signs():
    points = np.random.default_rng(0).uniform(0, 60, (50, 2))
    assert set(np.unique(encode(*map(tuple, points)))) == {-1, 1}


def test_similarity_falls_with_distance_across_borders():
    xs = [40, 42, 45, 50, 55, 60, 65]
    vectors = encode(*[(x, 30) for x in xs])
    similarities = algebra.cosine_similarity(vectors[0], vectors)
    assert similarities[0] == pytest.approx(1)
    assert np.all(np.diff(similarities) < 0)
    # A subinterval is 25 px: at 10 px, over the border at 50, 15/25 of the dimensions agree.
    assert similarities[3] == pytest.approx(0.6, abs=0.05)
    assert abs(similarities[-1]) < 0.1


def test_smooth_over_a_border():
    xs = np.arange(40, 61)
    vectors = encode(*[(x, 30) for x in xs])
    steps = algebra.cosine_similarity(vectors[:-1], vectors[1:])
    assert steps.min() > 0.93 and np.ptp(steps) < 0.04


def test_outside_and_degenerate_images():
    assert np.array_equal(encode((-5, 70)), encode((0, 60)))
    single = encode((0, 0), width=1, height=1)
    assert set(np.unique(single)) == {-1, 1}
    assert ENCODER.encode(LocalFeatures(*[np.empty((0, 2), np.float32)] * 2, 10, 10)).shape == (
        0,
        4096,
    )


def test_each_kind_of_random_vectors_has_a_stream_of_its_own():
    encoder = PositionEncoder(dimensions=64, n_x=3, n_y=3, seed=5)
    streams = [np.random.default_rng([5, axis]) for axis in range(3)]
    x, y, places = (algebra.random_vectors(4, 64, stream) for stream in streams)
    assert np.array_equal(encoder.basis_x, x) and np.array_equal(encoder.basis_y, y)
    sequence = SequenceBundler(dimensions=64, length=4, seed=5)
    ones = np.ones(64, np.float32)
    assert np.array_equal(sequence.push(ones), algebra.normalize(places[0]))


def test_splits_at_ends_and_borders():
    # 9 pixels and 2 subintervals of 4: a border belongs to the right, the end to the last one.
    encoder = PositionEncoder(dimensions=8, n_x=2, n_y=4, seed=0)
    splits = encoder.splits_x(np.array([-1, 0, 3, 4, 8, 9], np.float32), 9)
    assert splits.left.tolist() == [0, 0, 0, 1, 1, 1]
    assert splits.alpha.tolist() == [8, 8, 2, 8, 0, 0]
    # One pixel is at the beginning; of two the second is at the end.
    assert encoder.splits_y(np.array([0], np.float32), 1).left.tolist() == [0]
    two = encoder.splits_y(np.array([0, 1], np.float32), 2)
    assert two.left.tolist() == [0, 3] and two.alpha.tolist() == [8, 0]
