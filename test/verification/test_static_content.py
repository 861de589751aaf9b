# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What belongs to the camera: learned online, and told from a place by the rest of the image."""

from __future__ import annotations

import cv2
from hdc_place_recognition.features.cells import as_grid, CellEncoder, UnitCells
from hdc_place_recognition.features.compact import CompactKeypoints, quantize
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.hdc.words import WordHasher
from hdc_place_recognition.verification.geometry import Geometry, verify_geometry
from hdc_place_recognition.verification.settings import VerificationSettings
from hdc_place_recognition.verification.static_content import agreement_elsewhere, StaticContent
import numpy as np
from numpy.typing import NDArray
import pytest

WIDTH, HEIGHT = 320, 240
Symbols = tuple[NDArray[np.uint8], NDArray[np.float32]]


def image(rng: np.random.Generator, count: int = 60) -> Symbols:
    """Return symbols and points of keypoints."""
    symbols = rng.integers(0, 128, (count, 8, 2)).astype(np.uint8)
    return symbols, rng.uniform(0, 0.75, (count, 2)).astype(np.float32)


def with_caption(rng: np.random.Generator, caption: Symbols, jitter: float = 0.0002) -> Symbols:
    """Return another image with a caption, whose keypoints come first."""
    (symbols, points), (others, places) = caption, image(rng)
    moved = points + rng.normal(0, jitter, points.shape).astype(np.float32)
    return np.concatenate([symbols, others]), np.concatenate([moved, places]).clip(0, 1)


def test_a_caption_is_learned_and_places_are_not():
    rng, content = np.random.default_rng(0), StaticContent()
    caption = image(rng, 20)
    for _ in range(30):
        codes = content.codes(*with_caption(rng, caption))
        static = content.static(codes)
        assert content.count(codes)
    assert static[:20].mean() > 0.9 and static[20:].mean() < 0.05


def test_two_different_images_are_enough_and_one_is_not():
    rng, content = np.random.default_rng(1), StaticContent()
    caption = image(rng, 20)
    found = []
    for _ in range(3):
        codes = content.codes(*with_caption(rng, caption, 0))
        found.append(content.static(codes))
        content.count(codes)
    assert not found[0].any() and not found[1].any()
    assert found[2][:20].all() and not found[2][20:].any()


def test_a_camera_that_stands_still_teaches_nothing():
    rng, content = np.random.default_rng(2), StaticContent()
    codes = content.codes(*image(rng))
    assert content.count(codes)
    assert not any(content.count(codes) for _ in range(20))
    assert not content.static(codes).any()


def test_a_place_that_is_seen_rarely_is_not_static():
    rng, content = np.random.default_rng(3), StaticContent()
    place = content.codes(*image(rng))
    for number in range(150):
        content.count(place if number in (0, 80) else content.codes(*image(rng, 20)))
    assert not content.static(place).any()


def test_counts_neither_overflow_nor_stay_for_ever():
    rng, content = np.random.default_rng(4), StaticContent()
    caption = image(rng, 20)
    for _ in range(400):
        codes = content.codes(*with_caption(rng, caption, 0))
        content.count(codes)
    assert content.static(codes)[:20].all()
    # Once the caption is gone, it is forgotten.
    for _ in range(1500):
        content.count(content.codes(*image(rng, 10)))
    assert not content.static(codes)[:20].any()


def test_the_same_symbol_elsewhere_is_not_static():
    rng, content = np.random.default_rng(5), StaticContent()
    symbols, points = image(rng, 20)
    for _ in range(10):
        content.count(content.codes(*with_caption(rng, (symbols, points), 0)))
    assert not content.static(content.codes(symbols, (points + 0.1) % 0.75)).any()
    different = (symbols + 1).astype(np.uint8) % 128
    assert not content.static(content.codes(different, points)).any()


def test_images_of_any_shape_and_without_keypoints():
    content = StaticContent()
    codes = content.codes(np.empty((0, 8, 2), np.uint8), np.empty((0, 2), np.float32))
    assert not content.count(codes) and content.static(codes).shape == (0,)
    points = np.array([[0, 0], [1, 0.5], [1, 1], [1, 5]], np.float32)
    codes = content.codes(np.full((4, 8, 2), 127, np.uint8), points)
    assert content.count(codes) and codes.shape == (4, 8) and codes.min() >= 0
    assert content.nbytes < 14_000_000


# For a pair of images


def cells(seed: int) -> NDArray[np.float32]:
    vectors = np.random.default_rng(seed).standard_normal((15, 20, 32))
    return (vectors / np.linalg.norm(vectors, axis=2, keepdims=True)).astype(np.float32)


def unit(vectors: NDArray[np.float32]) -> UnitCells:
    rows, columns, channels = vectors.shape
    return UnitCells(vectors.reshape(-1, channels), rows, columns, rows * columns)


def test_the_rest_of_the_image_tells_a_place_from_a_caption():
    first, second = cells(0), cells(1)
    second[12:] = first[12:]
    points = np.stack(np.meshgrid(np.linspace(0, 1, 20), [0.65, 0.7, 0.74]), -1).reshape(-1, 2)
    assert abs(agreement_elsewhere(unit(first), unit(second), points)) < 0.05
    assert agreement_elsewhere(unit(first), unit(first), points) == pytest.approx(1, abs=1e-5)


def test_grids_of_different_shapes_are_compared_where_both_are():
    points = np.full((1, 2), 0.5)
    grid = cells(0)
    assert agreement_elsewhere(unit(grid), unit(grid[:13, :18]), points) > 0.99


def test_inliers_everywhere_leave_nothing_to_disagree():
    x, y = np.meshgrid(np.arange(20), np.arange(15))
    points = np.stack([x, y], axis=-1).reshape(-1, 2) / 20
    assert agreement_elsewhere(unit(cells(0)), unit(cells(1)), points) == 1


# Drawn images with a caption


def scene(seed: int) -> NDArray[np.float32]:
    """Return a texture with structure of several sizes."""
    rng = np.random.default_rng(seed)
    values = np.zeros((HEIGHT, WIDTH), np.float32)
    for size in (2, 4, 8, 16):
        noise = rng.standard_normal((HEIGHT, WIDTH)).astype(np.float32)
        values += size * cv2.GaussianBlur(noise, (0, 0), size)
    return values / values.std()


def captioned(values: NDArray[np.float32], noise: int = 0) -> NDArray[np.uint8]:
    """Return an image with a line of text below, and noise of a camera."""
    drawn = (128 + 40 * values).clip(0, 255).astype(np.uint8)
    drawn[200:] = 0
    cv2.putText(drawn, 'CAM 07 N-42 GATE', (4, 230), cv2.FONT_HERSHEY_SIMPLEX, 1, 255, 2)
    grain = np.random.default_rng(noise).integers(-4, 5, drawn.shape)
    return (drawn + grain).clip(0, 255).astype(np.uint8)


class Views:
    """Keypoints and cells of the images of one camera."""

    def __init__(self) -> None:
        self.extractor = create_extractor('rootsift', image_width=WIDTH, max_features=300)
        self.grid = create_extractor('gradient_grid', image_width=WIDTH, max_features=1000)
        self.encoder = CellEncoder()
        for seed in range(100, 110):
            self.encoder.update(as_grid(self.grid.extract(captioned(scene(seed), seed))))

    def of(self, drawn: NDArray[np.uint8]) -> tuple[CompactKeypoints, UnitCells]:
        grid = as_grid(self.grid.extract(drawn))
        return quantize(self.extractor.extract(drawn)), self.encoder.encode(grid).unpack()

    def geometry(self, first: NDArray[np.uint8], second: NDArray[np.uint8]) -> Geometry:
        (query, query_cells), (keyframe, keyframe_cells) = self.of(first), self.of(second)

        def is_static(points: NDArray[np.float32]) -> bool:
            agreement = agreement_elsewhere(query_cells, keyframe_cells, points)
            return agreement < VerificationSettings().still_agreement

        return verify_geometry(query, keyframe, is_static=is_static)


@pytest.fixture(scope='module')
def views() -> Views:
    return Views()


def test_a_caption_on_different_images_gives_no_inliers(views):
    first, second = captioned(scene(0), 1), captioned(scene(1), 2)
    (query, _), (keyframe, _) = views.of(first), views.of(second)
    assert verify_geometry(query, keyframe).strength > 15
    assert views.geometry(first, second).strength < 4


def test_the_same_place_seen_from_the_same_spot_keeps_its_inliers(views):
    first, second = captioned(scene(0), 1), captioned(scene(0), 2)
    (query, _), (keyframe, _) = views.of(first), views.of(second)
    found = views.geometry(first, second)
    assert found == verify_geometry(query, keyframe) and found.inliers > 100


def test_a_caption_learned_from_other_images_does_not_count(views):
    content, hasher = StaticContent(), WordHasher()

    def codes(keypoints: CompactKeypoints) -> NDArray[np.int32]:
        return content.codes(hasher.symbols(keypoints.descriptors), keypoints.points)

    for seed in range(20, 26):
        content.count(codes(views.of(captioned(scene(seed), seed))[0]))
    query = views.of(captioned(scene(0), 1))[0]
    static = content.static(codes(query))
    # The text is in the lower fifth.
    assert (query.points[static, 1] > 0.6).all() and static.sum() > 10
    unlike, alike = (views.of(captioned(scene(seed), 2))[0] for seed in (1, 0))
    assert verify_geometry(query, unlike, static).strength < 8
    assert verify_geometry(query, alike, static).inliers > 80
