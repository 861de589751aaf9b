# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Geometry of two views: scenes of known depth, and those that only look alike."""

from concurrent.futures import ThreadPoolExecutor

import cv2
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.compact import CompactKeypoints, pack, quantize
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.verification.geometry import (
    _match_points,
    _spread,
    Geometry,
    match,
    verify_geometry,
)
import numpy as np
from numpy.typing import NDArray
import pytest

WIDTH, HEIGHT = 320, 240


def votes(query: CompactKeypoints, keyframe: CompactKeypoints) -> int:
    """Return how many matches agree with one similarity transform."""
    matched = _match_points(query, keyframe)
    return 0 if matched is None else int(np.count_nonzero(matched.voting))


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
    geometry = verify_geometry(view(8, 8), view(0, 0))
    assert geometry.inliers > 100 and geometry.guided > 100 and geometry.spread >= 12
    # What is at x in the query was 8 pixels further right in the earlier image.
    assert geometry.shift_x == pytest.approx(8 / WIDTH, abs=2e-3)
    assert geometry.shift_y == pytest.approx(0, abs=2e-3)


def test_parallax_is_followed_by_the_fundamental_matrix():
    geometry = verify_geometry(view(8, 32), view(0, 0))
    assert geometry.inliers > 60
    assert 8 / WIDTH - 2e-3 < geometry.shift_x < 32 / WIDTH + 2e-3


def test_scale_and_rotation_are_followed_by_the_votes():
    image = scene(1, WIDTH)
    turn = cv2.getRotationMatrix2D((WIDTH / 2, HEIGHT / 2), 20, 1.2)
    turned = np.asarray(cv2.warpAffine(image, turn, (WIDTH, HEIGHT)), np.uint8)
    geometry = verify_geometry(keypoints(turned), keypoints(image))
    assert geometry.inliers > 40 and geometry.guided > geometry.inliers


def test_different_textures_are_not_verified():
    geometry = verify_geometry(keypoints(scene(1, WIDTH)), keypoints(scene(2, WIDTH)))
    assert geometry.strength < 8


def test_one_object_elsewhere_has_no_spread():
    first, second = (cv2.GaussianBlur(scene(seed, WIDTH), (0, 0), 9) for seed in (3, 4))
    noise = np.random.default_rng(5).integers(0, 256, (60, 80), dtype=np.uint8)
    patch = cv2.GaussianBlur(noise, (0, 0), 2) * 3
    first[60:120, 80:160], second[120:180, 160:240] = patch, patch
    geometry = verify_geometry(keypoints(first), keypoints(second))
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
        assert isinstance(verify_geometry(*pair), Geometry)


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
        found = quantize(features)
        assert votes(found, found) == 20 and verify_geometry(found, found).spread <= 4


def test_match_is_mutual_and_passes_the_ratio_test():
    query = np.array([[0, 0], [100, 0], [0, 100], [51, 51]], np.float32)
    earlier = np.array([[1, 0], [98, 0], [0, 200], [50, 52], [52, 50]], np.float32)
    # 0 and 1 have one partner each; 2 is as near to none; 3 has two that are equally near.
    assert match(query, earlier).tolist() == [[0, 0], [1, 1]]
    assert match(query[:1], earlier).shape == (0, 2)


def test_same_answer_again_and_on_threads():
    first, second = view(8, 32), view(0, 0)
    expected = verify_geometry(first, second)
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda _: verify_geometry(first, second), range(16)))
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
    geometry = verify_geometry(keypoints(larger), keypoints(image))
    assert geometry.inliers > 100 and abs(geometry.shift_x) < 2e-3


def test_landmarks_need_sizes_and_angles():
    features = LocalFeatures(np.zeros((1, 2), np.float32), np.zeros((1, 8), np.float32), 4, 4)
    with pytest.raises(PlaceRecognitionError, match='rootsift'):
        quantize(features)


# By hand: each keypoint has a descriptor of its own


def compact(
    points: NDArray[np.float64] | list[tuple[float, float]], log_size: int = 0, angle: int = 0
) -> CompactKeypoints:
    """Return keypoints at shares of a square image, the same ones in the same order."""
    count = len(points)
    numbers = np.where(np.random.default_rng(42).random((count, 128)) < 0.1, 12, 0)
    return CompactKeypoints(
        np.rint(np.array(points) * 65535).astype(np.uint16),
        np.full(count, log_size, np.uint8),
        np.full(count, angle, np.uint8),
        pack(numbers),
        1.0,
    )


SQUARE = [(0.2, 0.2), (0.4, 0.2), (0.2, 0.4), (0.4, 0.4)]


def test_four_matches_vote_and_three_do_not():
    right = [(x + 0.3, y - 0.1) for x, y in SQUARE]
    assert votes(compact(SQUARE), compact(right)) == 4
    geometry = verify_geometry(compact(SQUARE), compact(right))
    # Too few for a fundamental matrix.
    assert geometry.inliers == 0 and geometry.strength == 0
    assert (geometry.shift_x, geometry.shift_y) == pytest.approx((0.3, -0.1), abs=1e-4)
    assert geometry.pairs.shape == (0, 2, 2)
    assert verify_geometry(compact(SQUARE[:3]), compact(right[:3])) == Geometry()


def test_sizes_and_orientations_propose_a_transform():
    # Twice as large and turned by a quarter: x, y become -2 y, 2 x.
    turned = [(0.9 - 2 * y, 2 * x - 0.3) for x, y in SQUARE]
    assert votes(compact(SQUARE), compact(turned, 32, 64)) == 4
    assert votes(compact(turned, 32, 64), compact(SQUARE)) == 4
    # Neither alone fits; each point then agrees with itself only.
    assert votes(compact(SQUARE), compact(turned, 32, 0)) == 1
    assert votes(compact(SQUARE), compact(turned, 0, 64)) == 1


def test_a_match_agrees_within_the_tolerance():
    for off, agreeing in ((0.05, 5), (0.07, 4)):
        query, keyframe = compact([*SQUARE, (0.3, 0.3)]), compact([*SQUARE, (0.3 + off, 0.3)])
        assert votes(query, keyframe) == agreeing
        # The shift is that of the matches that agree.
        assert verify_geometry(query, keyframe).shift_x == 0


def two_planes(count: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points in two views: those further down are nearer, and move by more."""
    points = np.random.default_rng(seed).uniform(0.02, 0.9, (count, 2))
    return points, points + np.where(points[:, 1:] > 0.5, [0.08, 0], [0.04, 0])


def test_enough_matches_have_a_fundamental_matrix():
    points, moved = two_planes(30)
    found = verify_geometry(compact(points), compact(moved))
    assert found.inliers > 25 and len(found.pairs) == found.inliers
    at, to = found.pairs[:, 0], found.pairs[:, 1]
    expected = at + np.where(at[:, 1:] > 0.5, [0.08, 0], [0.04, 0])
    assert to == pytest.approx(expected, abs=1e-4)
    few = verify_geometry(compact(points[:7]), compact(moved[:7]))
    assert few.inliers == 0 and few.guided > 0


def test_spread_is_that_of_the_image_with_fewer_cells():
    points, moved = two_planes(60, seed=1)
    # All in the upper left quarter: four cells of sixteen.
    small, large = compact(moved / 2, 0), compact(points, 32)
    assert verify_geometry(large, small).spread == 4
    assert verify_geometry(small, large).spread == 4
    assert verify_geometry(compact(points), compact(moved)).spread > 12


# Static content: what stays at its pixels


def still_and_moved(caption: int, place: int) -> tuple[CompactKeypoints, CompactKeypoints]:
    """Return two views: the first keypoints stay at their pixels, the others move."""
    points, moved = two_planes(caption + place)
    moved[:caption] = points[:caption]
    return compact(points), compact(moved)


def test_static_keypoints_do_not_count_where_they_stay():
    query = still_and_moved(30, 0)[0]
    static = np.arange(30) < 20
    assert verify_geometry(query, query).inliers == 30
    found = verify_geometry(query, query, static)
    assert (found.inliers, found.guided) == (10, 10) and len(found.pairs) == 10
    assert verify_geometry(query, query, np.ones(30, np.bool_)).strength == 0
    # They are not those of the camera if they move.
    both = [compact(points) for points in two_planes(30)]
    found = verify_geometry(*both, np.ones(30, np.bool_))
    assert found.inliers == verify_geometry(*both).inliers > 25


def test_inliers_that_mostly_stay_are_questioned():
    asked: list[NDArray[np.float32]] = []

    def is_static(points: NDArray[np.float32]) -> bool:
        asked.append(points)
        return True

    query, keyframe = still_and_moved(30, 0)
    found = verify_geometry(query, keyframe, is_static=is_static)
    assert (found.inliers, found.guided, found.spread) == (0, 0, 0)
    assert len(asked) == 1 and np.allclose(np.sort(asked[0], 0), np.sort(query.points, 0))
    # The same spot: they count.
    kept = verify_geometry(query, keyframe, is_static=lambda points: False)
    assert kept == verify_geometry(query, keyframe) and kept.inliers == 30


def test_inliers_that_mostly_move_are_not_questioned():
    def is_static(points: NDArray[np.float32]) -> bool:
        raise AssertionError(points)

    # Not more than half of them stay.
    for still in (0, 18):
        query, keyframe = still_and_moved(still, 40 - still)
        assert verify_geometry(query, keyframe, is_static=is_static).inliers > 25


def test_what_moves_counts_beside_a_caption():
    # Of a caption and a place that moves, all agree with one fundamental matrix.
    query, keyframe = still_and_moved(24, 16)
    plain = verify_geometry(query, keyframe)
    found = verify_geometry(query, keyframe, is_static=lambda points: True)
    assert plain.inliers > 30 and 0 < found.inliers <= 16 and found.guided == 0
    moves = found.pairs[:, 1] - found.pairs[:, 0]
    assert (np.hypot(*moves.T) > 3 / 320).all()


def test_strength_is_the_mean_of_inliers_and_guided_matches_and_not_below_inliers():
    assert Geometry(inliers=4, guided=9).strength == 6
    assert Geometry(inliers=30, guided=10).strength == 30
    assert Geometry(inliers=0, guided=50).strength == 0


def test_cells_begin_at_quarters():
    positions = np.array([[0, 0], [16383, 0], [16384, 0], [0, 49152], [65535, 65535]], np.uint16)
    assert _spread(positions) == 4 and _spread(positions[:2]) == 1
    assert _spread(np.array([[0, 16384], [16384, 0]], np.uint16)) == 2


def test_a_match_is_nearer_than_four_fifths_of_the_second():
    keyframe = np.array([[0], [90]], np.float32)
    # Distances 39 and 51, 40 and 50; four fifths of the second are 40.8 and 40.
    for value, found in ((39, [[0, 0]]), (40, [])):
        query = np.array([[value], [value]], np.float32)
        assert match(query, keyframe).tolist() == found
