# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Geometry of two views: scenes of known depth, and those that only look alike."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.compact import CompactKeypoints, quantize
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.verification.geometry import (
    _spread,
    Geometry,
    match,
    verify_geometry,
)
from hdc_place_recognition.verification.settings import VerificationSettings
import numpy as np
from numpy.typing import NDArray
import pytest

WIDTH, HEIGHT = 320, 240
SETTINGS = VerificationSettings()


def verify(query: CompactKeypoints, keyframe: CompactKeypoints) -> Geometry:
    return verify_geometry(query, keyframe, SETTINGS)


def scene(seed: int, width: int = 400) -> NDArray[np.uint8]:
    """Return a texture with structure of several sizes."""
    rng = np.random.default_rng(seed)
    image = np.zeros((HEIGHT, width), np.float32)
    for size in (2, 4, 8):
        noise = rng.standard_normal((HEIGHT, width)).astype(np.float32)
        image += size * cv2.GaussianBlur(noise, (0, 0), size)
    return cv2.normalize(image, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


def keypoints(image: NDArray[np.uint8]) -> CompactKeypoints:
    return quantize(create_extractor('rootsift', image_width=320, max_features=300).extract(image))


def view(far: int, near: int) -> CompactKeypoints:
    """Return a camera moved sideways: the lower half is nearer and moves by more pixels."""
    image = scene(1)
    upper, lower = np.vsplit(image, 2)
    moved = [np.roll(part, -by, axis=1)[:, :WIDTH] for part, by in ((upper, far), (lower, near))]
    return keypoints(np.vstack(moved))


def test_two_views_of_known_geometry_are_verified():
    geometry = verify(view(8, 8), view(0, 0))
    assert geometry.inliers > 100 and geometry.votes > 100 and geometry.spread >= 12
    # What is at x in the query was 8 pixels further right in the earlier image.
    assert geometry.shift_x == pytest.approx(8 / WIDTH, abs=2e-3)
    assert geometry.shift_y == pytest.approx(0, abs=2e-3)


def test_parallax_is_followed_by_the_fundamental_matrix():
    geometry = verify(view(8, 32), view(0, 0))
    assert geometry.inliers > 60
    assert 8 / WIDTH - 2e-3 < geometry.shift_x < 32 / WIDTH + 2e-3


def test_scale_and_rotation_are_followed_by_the_votes():
    image = scene(1, WIDTH)
    turn = cv2.getRotationMatrix2D((WIDTH / 2, HEIGHT / 2), 20, 1.2)
    turned = np.asarray(cv2.warpAffine(image, turn, (WIDTH, HEIGHT)), np.uint8)
    assert verify(keypoints(turned), keypoints(image)).votes > 40


def test_different_textures_are_not_verified():
    geometry = verify(keypoints(scene(1, WIDTH)), keypoints(scene(2, WIDTH)))
    assert min(geometry.votes, geometry.inliers) < 8


def test_one_object_elsewhere_has_no_spread():
    first, second = (cv2.GaussianBlur(scene(seed, WIDTH), (0, 0), 9) for seed in (3, 4))
    noise = np.random.default_rng(5).integers(0, 256, (60, 80), dtype=np.uint8)
    patch = cv2.GaussianBlur(noise, (0, 0), 2) * 3
    first[60:120, 80:160], second[120:180, 160:240] = patch, patch
    geometry = verify(keypoints(first), keypoints(second))
    assert geometry.inliers >= 12 and geometry.spread <= 2


@pytest.mark.parametrize(
    'image',
    [
        np.zeros((HEIGHT, WIDTH), np.uint8),
        np.zeros((1, 1), np.uint8),
        np.tile(np.array([[0, 255]], np.uint8).repeat(8, axis=1), (HEIGHT, 20)),
        scene(1, WIDTH)[:20, :20],
    ],
)
def test_degenerate_images_are_answered(image):
    found, textured = keypoints(np.ascontiguousarray(image)), keypoints(scene(1, WIDTH))
    for pair in ((found, textured), (textured, found), (found, found)):
        assert isinstance(verify(*pair), Geometry)


def test_coinciding_and_collinear_points_are_answered():
    rng = np.random.default_rng(0)
    for x, y in ((np.zeros(20), np.zeros(20)), (np.arange(20), np.arange(20))):
        descriptors = rng.random((20, 128)).astype(np.float32)
        features = LocalFeatures(
            np.stack([x, y], axis=1).astype(np.float32),
            descriptors / np.linalg.norm(descriptors, axis=1, keepdims=True),
            WIDTH,
            HEIGHT,
            sizes=np.full(20, 4, np.float32),
            angles=np.zeros(20, np.float32),
        )
        geometry = verify(quantize(features), quantize(features))
        assert geometry.votes == 20 and geometry.spread <= 2


def test_match_is_mutual_and_passes_the_ratio_test():
    query = np.array([[0, 0], [100, 0], [0, 100], [51, 51]], np.uint8)
    earlier = np.array([[1, 0], [98, 0], [0, 200], [50, 52], [52, 50]], np.uint8)
    # 0 and 1 have one partner each; 2 is as near to none; 3 has two that are equally near.
    assert match(query, earlier, 0.8).tolist() == [[0, 0], [1, 1]]
    assert match(query[:1], earlier, 0.8).shape == (0, 2)


def test_same_answer_again_and_on_threads():
    first, second = view(8, 32), view(0, 0)
    expected = verify(first, second)
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda _: verify(first, second), range(16)))
    assert set(found) == {expected}


def test_landmarks_are_small_and_near_what_they_stand_for():
    extractor = create_extractor('rootsift', image_width=320, max_features=300)
    features = extractor.extract(scene(1, WIDTH))
    kept = quantize(features)
    assert len(kept) == 300 and kept.nbytes == 300 * 70 + 640
    np.testing.assert_allclose(kept.points * WIDTH, features.keypoints + 0.5, atol=0.01)
    expected = np.minimum(features.descriptors, 0.4)
    np.testing.assert_allclose(kept.descriptors * (0.4 / 15), expected, atol=0.0134)
    sizes = np.abs(kept.frames)
    np.testing.assert_allclose(sizes / sizes[0], features.sizes / features.sizes[0], rtol=0.03)


def test_landmarks_do_not_depend_on_the_size_of_the_image():
    image = scene(1, WIDTH)
    larger = np.asarray(cv2.resize(image, None, fx=2, fy=2), np.uint8)
    geometry = verify(keypoints(larger), keypoints(image))
    assert geometry.inliers > 100 and abs(geometry.shift_x) < 2e-3


def test_landmarks_need_sizes_and_angles():
    features = LocalFeatures(np.zeros((1, 2), np.float32), np.zeros((1, 8), np.float32), 4, 4)
    with pytest.raises(PlaceRecognitionError, match='rootsift'):
        quantize(features)


# By hand: each keypoint has a descriptor of its own


def compact(
    points: list[tuple[float, float]], log_size: int = 0, angle: int = 0
) -> CompactKeypoints:
    """Return keypoints at shares of a square image, the same ones in the same order."""
    count = len(points)
    return CompactKeypoints(
        np.rint(np.array(points) * 65535).astype(np.uint16),
        np.full(count, log_size, np.uint8),
        np.full(count, angle, np.uint8),
        np.eye(count, 128, dtype=np.uint8) * 200,
        1.0,
    )


SQUARE = [(0.2, 0.2), (0.4, 0.2), (0.2, 0.4), (0.4, 0.4)]


def test_four_matches_vote_and_three_do_not():
    right = [(x + 0.3, y - 0.1) for x, y in SQUARE]
    geometry = verify(compact(SQUARE), compact(right))
    # Too few for a fundamental matrix.
    assert (geometry.votes, geometry.inliers, geometry.spread) == (4, 0, 0)
    assert (geometry.shift_x, geometry.shift_y) == pytest.approx((0.3, -0.1), abs=1e-4)
    assert geometry.pairs.shape == (0, 2, 2) and geometry.strength == 0
    assert verify(compact(SQUARE[:3]), compact(right[:3])) == Geometry()


def test_sizes_and_orientations_propose_a_transform():
    # Twice as large and turned by a quarter: x, y become -2 y, 2 x.
    turned = [(0.9 - 2 * y, 2 * x - 0.3) for x, y in SQUARE]
    assert verify(compact(SQUARE), compact(turned, 32, 64)).votes == 4
    assert verify(compact(turned, 32, 64), compact(SQUARE)).votes == 4
    # Neither alone fits; each point then agrees with itself only.
    assert verify(compact(SQUARE), compact(turned, 32, 0)).votes == 1
    assert verify(compact(SQUARE), compact(turned, 0, 64)).votes == 1


def test_a_match_agrees_within_the_tolerance():
    for off, votes in ((0.05, 5), (0.07, 4)):
        moved = [*SQUARE, (0.3 + off, 0.3)]
        geometry = verify(compact([*SQUARE, (0.3, 0.3)]), compact(moved))
        assert geometry.votes == votes
    # The shift is that of the matches that agree.
    assert geometry.shift_x == 0


def test_enough_matches_have_a_fundamental_matrix():
    rng = np.random.default_rng(0)
    points = rng.uniform(0.05, 0.9, (30, 2))
    # Two planes: those further down are nearer, and move by more.
    moved = points + np.where(points[:, 1:] > 0.5, [0.08, 0], [0.04, 0])
    query, keyframe = compact(points), compact(moved)
    few, enough = (
        verify_geometry(query, keyframe, replace(SETTINGS, least_epipolar=count))
        for count in (31, 30)
    )
    assert few.inliers == 0 and enough.inliers > 25
    assert len(enough.pairs) == enough.inliers
    at, to = enough.pairs[:, 0], enough.pairs[:, 1]
    expected = at + np.where(at[:, 1:] > 0.5, [0.08, 0], [0.04, 0])
    assert to == pytest.approx(expected, abs=1e-4)


def test_spread_is_that_of_the_image_with_fewer_cells():
    rng = np.random.default_rng(1)
    points = rng.uniform(0.01, 0.9, (60, 2))
    moved = points + np.where(points[:, 1:] > 0.5, [0.08, 0], [0.04, 0])
    # All in the upper left quarter: four cells of sixteen.
    small = moved / 2
    assert verify(compact(points), compact(small)).spread == 4
    assert verify(compact(small), compact(points)).spread == 4
    assert verify(compact(points), compact(moved)).spread > 12


def test_cells_begin_at_quarters():
    positions = np.array([[0, 0], [16383, 0], [16384, 0], [0, 49152], [65535, 65535]], np.uint16)
    assert _spread(positions) == 4 and _spread(positions[:2]) == 1
    assert _spread(np.array([[0, 16384], [16384, 0]], np.uint16)) == 2


def test_a_match_is_nearer_than_a_share_of_the_second():
    keyframe = np.array([[0], [10]], np.uint8)
    # Distances 3 and 7, 4 and 6; of the others half of the second is just not more.
    for value, found in ((3, 1), (4, 0)):
        query = np.array([[value], [200]], np.uint8)
        assert len(match(query, keyframe, 0.5)) == found
    twice = np.array([[0], [15]], np.uint8)
    assert len(match(np.array([[5], [200]], np.uint8), twice, 0.5)) == 0
    assert match(np.array([[5], [200]], np.uint8), twice, 0.6).tolist() == [[0, 0]]


def test_strength_is_the_geometric_mean():
    assert Geometry(votes=4, inliers=9).strength == 6
