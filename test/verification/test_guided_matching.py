# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Matches guided by a similarity transform, on keypoints made by hand."""

from dataclasses import replace

from hdc_place_recognition.features.compact import CompactKeypoints, pack
from hdc_place_recognition.verification.guided_matching import guided_matches
import numpy as np
from numpy.typing import NDArray
import pytest

FIVE = np.stack([np.arange(5)] * 2, axis=1)


def matches_of(
    query: CompactKeypoints, keyframe: CompactKeypoints, agreeing: NDArray[np.intp]
) -> NDArray[np.intp]:
    descriptors = query.descriptors, keyframe.descriptors
    return guided_matches(query, keyframe, agreeing, descriptors)


def scene(seed: int, count: int = 80) -> CompactKeypoints:
    """Return keypoints in the middle of a square image, from a third to two thirds."""
    rng = np.random.default_rng(seed)
    raw = rng.gamma(0.3, size=(count, 128)) ** 0.5
    descriptors = raw / np.linalg.norm(raw, axis=1, keepdims=True)
    return CompactKeypoints(
        rng.integers(21000, 44000, (count, 2)).astype(np.uint16),
        rng.integers(60, 120, count).astype(np.uint8),
        rng.integers(0, 256, count).astype(np.uint8),
        pack(np.rint(np.minimum(descriptors, 0.4) * 37.5)),
        1.0,
    )


def seen_again(
    keypoints: CompactKeypoints, zoom: float, degrees: float, order: NDArray[np.intp]
) -> CompactKeypoints:
    """Return the keypoints in another order, in a camera that was turned and zoomed."""
    points = keypoints.points @ np.array([1, 1j])
    moved = zoom * np.exp(1j * np.deg2rad(degrees)) * (points - 0.5 - 0.5j) + 0.45 + 0.52j
    positions = np.rint(np.stack([moved.real, moved.imag], axis=1) * 65535)
    return CompactKeypoints(
        positions.astype(np.uint16)[order],
        np.rint(keypoints.log_sizes + 32 * np.log2(zoom)).astype(np.uint8)[order],
        np.rint(keypoints.angles + 256 * degrees / 360).astype(np.uint8)[order],
        keypoints.packed[order],
        1.0,
    )


@pytest.mark.parametrize(('zoom', 'degrees'), [(1.0, 0), (1.4, 35), (0.6, -80), (1.0, 180)])
def test_what_a_roll_and_zoom_moved_is_found(zoom, degrees):
    query = scene(0)
    order = np.random.default_rng(1).permutation(len(query))
    keyframe = seen_again(query, zoom, degrees, order)
    agreeing = np.stack([np.arange(5), np.argsort(order)[:5]], axis=1)
    found = matches_of(query, keyframe, agreeing)
    assert len(found) == len(query)
    assert np.array_equal(order[found[:, 1]], found[:, 0])


def test_matches_have_the_size_and_orientation_that_are_predicted():
    query = scene(1)
    assert len(matches_of(query, query, FIVE)) == len(query)
    for log_sizes, angles, matched in (
        (16, 0, True),
        (32, 0, False),
        (0, 16, True),
        (0, 64, False),
    ):
        keyframe = replace(
            query,
            log_sizes=(query.log_sizes + log_sizes).astype(np.uint8),
            angles=(query.angles.astype(int) + angles).astype(np.uint8),
        )
        assert len(matches_of(query, keyframe, FIVE)) == len(query) * matched


def test_matches_are_where_they_are_predicted():
    query, rng = scene(2), np.random.default_rng(0)
    far = rng.choice(np.arange(5, 80), 20, replace=False)
    positions = query.positions.copy()
    positions[far, 1] += 2500
    found = matches_of(query, replace(query, positions=positions), FIVE)
    assert not set(far.tolist()) & set(found[found[:, 0] == found[:, 1], 0].tolist())
    assert len(found) >= 60


def test_matches_are_similar():
    query, unlike = scene(3), scene(4)
    keyframe = replace(query, packed=unlike.packed)
    assert len(matches_of(query, keyframe, FIVE)) < 8


def test_matches_are_mutually_nearest():
    query = scene(5)
    twice = CompactKeypoints(
        *(np.concatenate([part, part]) for part in (query.positions, query.log_sizes)),
        np.concatenate([query.angles, query.angles]),
        np.concatenate([scene(6).packed, query.packed]),
        1.0,
    )
    found = matches_of(query, twice, FIVE)
    assert np.array_equal(found, np.stack([np.arange(80), np.arange(80, 160)], axis=1))


def test_unrelated_images_have_few():
    agreeing = np.stack([np.arange(4)] * 2, axis=1)
    assert len(matches_of(scene(7, 200), scene(8, 200), agreeing)) < 8


@pytest.mark.parametrize(
    'agreeing',
    [FIVE[:0], FIVE[:3], np.zeros((5, 2), np.intp), np.array([[n, 0] for n in range(5)])],
)
def test_too_few_or_all_at_one_point_give_none(agreeing):
    query = scene(9)
    assert matches_of(query, query, agreeing).shape == (0, 2)
