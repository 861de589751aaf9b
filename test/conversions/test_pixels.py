# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Scaling to 8 bits, with values computed by hand."""

from hdc_place_recognition.conversions.pixels import as_uint8, ValueRange
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
import pytest

GREATEST = np.finfo(np.float32).max
LEAST = np.finfo(np.float32).smallest_subnormal


def test_uint8_is_returned_as_it_is():
    gray = np.array([[0, 1], [254, 255]], np.uint8)
    assert np.shares_memory(as_uint8(gray), gray)
    np.testing.assert_array_equal(as_uint8(gray), gray)


def test_uint16_is_full_scale():
    image = np.array([[0, 255, 256, 257], [0x7FFF, 0x8000, 0xFEFF, 0xFFFF]], np.uint16)
    np.testing.assert_array_equal(as_uint8(image), [[0, 0, 1, 1], [127, 128, 254, 255]])


@pytest.mark.parametrize('factor', [256, 257])
def test_uint16_inverts_both_scalings_from_8_bits(factor):
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
    np.testing.assert_array_equal(as_uint8(levels.astype(np.uint16) * np.uint16(factor)), levels)


def test_float_is_scaled_by_its_range():
    image = np.array([[-1.0, -0.5, 0.0], [0.5, 0.9, 1.0]], np.float32)
    np.testing.assert_array_equal(as_uint8(image), [[0, 64, 128], [191, 242, 255]])


def test_values_that_are_not_finite_become_0():
    image = np.array([[2.0, np.nan, 3.0], [np.inf, 4.0, -np.inf]], np.float32)
    np.testing.assert_array_equal(as_uint8(image), [[0, 0, 128], [0, 255, 0]])


@pytest.mark.filterwarnings('error')
def test_a_signaling_nan_gives_no_warning():
    image = np.array([[0x7F800001, 0, 0x3F800000]], np.uint32).view(np.float32)
    np.testing.assert_array_equal(as_uint8(image), [[0, 0, 255]])


@pytest.mark.parametrize('value', [0.0, 7.5, -3.0, np.nan, np.inf])
def test_a_constant_float_image_is_black(value):
    assert not as_uint8(np.full((2, 3), value, np.float32)).any()


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('extreme', [GREATEST, LEAST])
def test_extreme_ranges_of_float_images(extreme):
    image = np.array([[-extreme, 0.0, extreme]], np.float32)
    np.testing.assert_array_equal(as_uint8(image), [[0, 128, 255]])


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16, np.float32])
def test_alpha_is_dropped_before_scaling(dtype):
    bgr = np.array([[[0, 1, 2], [3, 4, 5]]], dtype)
    bgra = np.dstack([bgr, np.full((1, 2), 200, dtype)])
    result = as_uint8(bgra)
    assert result.shape == (1, 2, 3)
    np.testing.assert_array_equal(result, as_uint8(bgr))


def test_one_channel_becomes_gray():
    assert as_uint8(np.zeros((4, 5, 1), np.uint8)).shape == (4, 5)


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize('shape', [(1, 1), (6, 4), (6, 4, 1), (6, 4, 3), (6, 4, 4)])
def test_the_result_is_contiguous_and_the_input_unchanged(dtype, shape):
    whole = np.random.default_rng(1).integers(0, 255, shape).astype(dtype)
    before = whole.copy()
    for image in (whole, whole[::-1], whole[:, ::2], whole[::2, ::-1]):
        result = as_uint8(image)
        assert result.dtype == np.uint8
        assert result.flags.c_contiguous
        assert result.shape[:2] == image.shape[:2]
    np.testing.assert_array_equal(whole, before)


@pytest.mark.parametrize(
    'image',
    [
        np.zeros((2, 3), np.float64),
        np.zeros((2, 3), np.int16),
        np.zeros((2, 3), bool),
        np.zeros((2, 3), np.dtype(np.uint16).newbyteorder()),
        np.zeros((2, 3, 2), np.uint8),
        np.zeros((2, 3, 5), np.uint8),
        np.zeros((6,), np.uint8),
        np.zeros((1, 2, 3, 3), np.uint8),
        np.zeros((0, 3), np.uint8),
        np.zeros((2, 0, 3), np.float32),
    ],
    ids=lambda image: f'{image.shape}-{image.dtype}',
)
def test_unsupported_shapes_and_types_are_errors(image):
    with pytest.raises(PlaceRecognitionError, match=r'image has shape \(.*\) and dtype \S+; need'):
        as_uint8(image)


# --- Values that use a part of 16 bits


@pytest.mark.parametrize('bits', [8, 10, 12, 14, 16])
def test_16_bit_images_are_scaled_by_the_bits_they_use(bits):
    gray = np.arange(256, dtype=np.uint16).reshape(16, 16)
    np.testing.assert_array_equal(as_uint8(gray << (bits - 8)), gray)


def test_a_narrow_range_is_spread():
    thermal = np.linspace(21000, 21765, 320 * 240).astype(np.uint16).reshape(240, 320)
    result = as_uint8(thermal)
    assert (result.min(), result.max()) == (25, 231)  # a margin of an eighth on both sides
    assert (np.diff(result.ravel().astype(int)) >= 0).all()


def test_dead_pixels_do_not_count():
    thermal = np.linspace(21000, 21765, 320 * 240).astype(np.uint16).reshape(240, 320)
    thermal[0, :5], thermal[1, :5] = 0, 65535
    assert np.ptp(as_uint8(thermal)[2:].astype(int)) > 180


def test_noise_is_not_amplified():
    noise = np.random.default_rng(0).integers(20000, 20003, (48, 64), np.uint16, endpoint=True)
    assert np.ptp(as_uint8(noise)) <= 3


def test_a_dark_image_of_a_12_bit_camera_stays_dark():
    values = ValueRange()
    bright = np.linspace(0, 4095, 6400).astype(np.uint16).reshape(80, 80)
    assert as_uint8(bright, values).max() == 255
    assert as_uint8(bright // 8, values).max() == 31
    assert as_uint8(bright // 8).max() == 255  # without the images before


def test_the_range_of_a_thermal_camera_is_stable():
    values = ValueRange()
    scene = np.linspace(21000, 21765, 6400).astype(np.uint16).reshape(80, 80)
    before = as_uint8(scene, values).astype(int)
    part = as_uint8(scene[20:60], values).astype(int)
    assert np.abs(part - before[20:60]).max() <= 3
    assert np.abs(as_uint8(scene[20:60]).astype(int) - before[20:60]).max() > 20


def test_an_outlier_is_forgotten():
    values = ValueRange()
    depth = np.linspace(0, 5, 6400, dtype=np.float32).reshape(80, 80)
    spoiled = depth.copy()
    spoiled[0, 0] = 1000
    assert as_uint8(spoiled, values)[-1, -1] == 1
    for _ in range(300):
        result = as_uint8(depth, values)
    assert result.max() > 200
