# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Dense cells: compact form, running mean, static content, similarity of a pair."""

from __future__ import annotations

from hdc_place_recognition.features.cells import as_grid, CellEncoder, compare, UnitCells
from hdc_place_recognition.features.local_features import LocalFeatures
import numpy as np
import pytest

CHANNELS = 112


def scene(seed: int, rows: int = 10, columns: int = 14) -> np.ndarray:
    """Return (rows, columns, 112) float32 random features."""
    return np.random.default_rng(seed).standard_normal((rows, columns, CHANNELS), np.float32)


def unit(grid: np.ndarray) -> UnitCells:
    return CellEncoder().encode(grid).unpack()


def test_a_cell_takes_two_bits_a_number() -> None:
    cells = CellEncoder().encode(scene(0, 15, 20))
    assert cells.codes.shape == (300, 28)
    assert cells.nbytes <= 9000


def test_quantized_numbers_keep_sign_and_order() -> None:
    grid = scene(1)
    vectors = unit(grid).vectors
    flat = grid.reshape(-1, CHANNELS)
    standard = (flat - flat.mean(0)) / flat.std(0)
    cosines = (vectors * standard).sum(1) / np.linalg.norm(standard, axis=1)
    assert cosines.min() > 0.9
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1, atol=1e-5)


@pytest.mark.parametrize('channels', [1, 3, 61, 112])
def test_any_number_of_channels(channels: int) -> None:
    grid = scene(0)[..., :channels]
    assert unit(grid).vectors.shape == (140, channels)


def test_the_same_image_is_most_similar_and_not_displaced() -> None:
    match = compare(unit(scene(0)), unit(scene(0)))
    assert match.similarity == pytest.approx(2, abs=1e-5)
    assert match.overlap == pytest.approx(1, abs=1e-5)
    assert (match.shift_x, match.shift_y) == (0, 0)


@pytest.mark.parametrize(('x', 'y'), [(3, 0), (-4, 1), (0, -2), (6, 3)])
def test_a_displaced_view_is_found_with_its_displacement(x: int, y: int) -> None:
    world = scene(0, 30, 40)
    here = world[10:20, 12:26]
    there = np.roll(world, (y, x), axis=(0, 1))[10:20, 12:26]
    match = compare(unit(here), unit(there))
    other = compare(unit(here), unit(scene(9)))
    assert abs(match.shift_x - x) <= 1
    assert abs(match.shift_y - y) <= 1
    assert match.similarity > 4 * other.similarity


def test_grids_of_two_shapes_compare_and_symmetrically() -> None:
    world = scene(0, 20, 20)
    wide, tall = unit(world[4:11]), unit(world[:, 3:15])
    match, back = compare(wide, tall), compare(tall, wide)
    assert match.similarity == pytest.approx(back.similarity, abs=1e-5)
    assert (match.shift_x, match.shift_y) == (-back.shift_x, -back.shift_y)
    assert match.similarity > 3 * compare(wide, unit(scene(7, 20, 12))).similarity


def test_single_row_and_single_cell() -> None:
    assert compare(unit(scene(0, 1, 12)), unit(scene(0, 12, 1))).similarity >= 0
    assert compare(unit(scene(0, 1, 1)), unit(scene(0))).similarity == 0


def test_an_image_of_one_color_agrees_with_nothing() -> None:
    blank = np.ones((10, 14, CHANNELS), np.float32)
    assert compare(unit(blank), unit(scene(0))).similarity == 0
    assert compare(unit(blank), unit(blank)).similarity == 0


def test_what_images_share_is_subtracted() -> None:
    common = 3 * scene(100)
    encoder = CellEncoder()
    plain = compare(unit(common + scene(0)), unit(common + scene(1))).similarity
    for seed in range(40):
        encoder.update(common + scene(seed))
    a, b = (encoder.encode(common + scene(seed)).unpack() for seed in (0, 1))
    assert plain > 1
    assert compare(a, b).similarity < 0.2


def test_encode_changes_nothing() -> None:
    encoder = CellEncoder()
    encoder.update(scene(0))
    first, second = encoder.encode(scene(1)), encoder.encode(scene(1))
    assert np.array_equal(first.codes, second.codes)


def test_static_cells_are_learnt_and_do_not_count() -> None:
    """A bumper that fills the lower third, otherwise different images."""
    encoder, bumper = CellEncoder(), scene(100)[7:]
    for seed in range(30):
        encoder.update(with_bumper(scene(seed), bumper))
    static = encoder.static((10, 14, CHANNELS)).reshape(10, 14)
    assert static[7:].all()
    assert not static[:7].any()
    cells = encoder.encode(with_bumper(scene(50), bumper)).unpack()
    assert cells.count == 7 * 14
    assert not cells.vectors.reshape(10, 14, -1)[7:].any()
    other = encoder.encode(with_bumper(scene(51), bumper)).unpack()
    assert compare(cells, other).similarity < 0.1


def with_bumper(grid: np.ndarray, bumper: np.ndarray) -> np.ndarray:
    upper, lower = np.split(grid, [len(grid) - len(bumper)])
    return np.concatenate([upper, bumper + 0.1 * lower])


def test_nothing_is_static_before_enough_images_or_when_most_of_it_is() -> None:
    encoder = CellEncoder()
    for _ in range(10):
        encoder.update(scene(0))
    assert not encoder.static((10, 14, CHANNELS)).any()
    for _ in range(30):
        encoder.update(scene(0))
    assert not encoder.static((10, 14, CHANNELS)).any()


def test_means_are_resampled_to_another_grid() -> None:
    """What images share is known in another grid too; so is the bumper."""
    encoder, common = CellEncoder(), np.zeros((10, 14, CHANNELS), np.float32)
    common[:, :7] = 3 * scene(100)[0, 0]
    bumper = scene(101)[9:]
    for seed in range(40):
        encoder.update(with_bumper(common + scene(seed), bumper))
    half = (5, 7, CHANNELS)
    assert not encoder.static(half).any()
    encoder.update((common + scene(40))[::2, ::2])
    assert encoder.static(half).shape == (35,)
    grids = [(common + scene(seed))[::2, ::2] for seed in (50, 51)]
    known, fresh = (
        compare(*(source.encode(grid).unpack() for grid in grids)).similarity
        for source in (encoder, CellEncoder())
    )
    assert known < 0.6 * fresh


def test_a_larger_grid_knows_what_is_static() -> None:
    encoder, bumper = CellEncoder(), scene(100)[7:]
    for seed in range(30):
        encoder.update(with_bumper(scene(seed), bumper))
    twice = scene(31).repeat(2, axis=0).repeat(2, axis=1)
    twice[14:] = bumper.repeat(2, axis=0).repeat(2, axis=1)
    encoder.update(twice)
    static = encoder.static((20, 28, CHANNELS)).reshape(20, 28)
    assert static[16:].all() and not static[:12].any()


def test_other_features_start_the_mean_again() -> None:
    encoder, fresh = CellEncoder(), CellEncoder()
    for seed in range(30):
        encoder.update(scene(seed))
    grid, few = scene(1)[..., :30], scene(2)[..., :30]
    assert np.array_equal(encoder.encode(grid).codes, fresh.encode(grid).codes)
    for source in (encoder, fresh):
        source.update(few)
    assert np.array_equal(encoder.encode(grid).codes, fresh.encode(grid).codes)


def test_features_on_a_grid_are_reshaped_and_others_are_not() -> None:
    x, y = np.meshgrid(np.arange(5, dtype=np.float32), np.arange(3, dtype=np.float32))
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    descriptors = np.arange(30, dtype=np.float32).reshape(15, 2)
    grid = as_grid(LocalFeatures(points, descriptors, 320, 240))
    assert grid is not None
    assert grid.shape == (3, 5, 2)
    assert np.array_equal(grid[1, 2], descriptors[7])
    scattered = points + np.random.default_rng(0).random((15, 2), np.float32)
    assert as_grid(LocalFeatures(scattered, descriptors, 320, 240)) is None
    assert as_grid(LocalFeatures(points[:14], descriptors[:14], 320, 240)) is None
    assert as_grid(LocalFeatures(points[:0], descriptors[:0], 320, 240)) is None
