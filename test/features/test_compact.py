# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Keypoints in compact form: the numbers of a few keypoints, by hand."""

from hdc_place_recognition.features.compact import CompactKeypoints, pack, quantize
from hdc_place_recognition.features.local_features import LocalFeatures
import numpy as np
import pytest

FEATURES = LocalFeatures(
    keypoints=np.array([[-0.5, -0.5], [159.5, 59.5], [319.5, 239.5], [400, -9]], np.float32),
    descriptors=np.array([[0, 0.4], [0.2, 0.08], [-1, 2], [0.013, 0.0134]], np.float32),
    width=320,
    height=240,
    sizes=np.array([1, 2, 320, 0.5], np.float32),
    angles=np.array([0, 90, 359.9, 181], np.float32),
)


def test_positions_are_shares_of_width_and_height():
    positions = quantize(FEATURES).positions
    # Half of 65535 is rounded to the even number, a quarter is 16383.75.
    assert positions.tolist() == [[0, 0], [32768, 16384], [65535, 65535], [65535, 0]]
    assert positions.dtype == np.uint16


def test_sizes_have_32_steps_an_octave_from_a_320th_of_the_width():
    found = quantize(FEATURES)
    # 320 pixels are 8.3 octaves, of which 8 can be kept.
    assert found.log_sizes.tolist() == [0, 32, 255, 0]
    assert found.log_sizes.dtype == np.uint8


def test_a_full_turn_has_256_steps():
    found = quantize(FEATURES)
    # 359.9 degrees are rounded to a full turn, which is 0; 181 degrees are 128.7 steps.
    assert found.angles.tolist() == [0, 64, 0, 129]
    assert found.angles.dtype == np.uint8


def test_descriptors_have_16_levels_up_to_04():
    found = quantize(FEATURES)
    # Half of 15 is rounded to the even number.
    assert found.descriptors.tolist() == [[0, 15], [8, 3], [0, 15], [0, 1]]
    assert found.descriptors.dtype == np.float32 and found.unit == 37.5


def test_two_numbers_are_packed_in_a_byte():
    assert quantize(FEATURES).packed.tolist() == [[15], [0x83], [15], [1]]
    numbers = np.random.default_rng(0).integers(0, 16, (5, 128))
    found = CompactKeypoints(*(np.empty((5, 2), np.uint8),) * 3, pack(numbers), 1.0)
    assert np.array_equal(found.descriptors, numbers)
    assert pack(np.array([[-3, 99]])).tolist() == [[15]]
    assert pack(np.empty((0, 128))).shape == (0, 64)


def test_points_are_in_widths():
    found = quantize(FEATURES)
    assert found.aspect == 0.75
    expected = [[0, 0], [0.5, 0.1875], [1, 0.75], [1, 0]]
    assert np.allclose(found.points, expected, atol=1e-5)
    assert found.points.dtype == np.float32


def test_frames_are_sizes_and_orientations():
    frames = quantize(FEATURES).frames
    assert frames.dtype == np.complex64
    # The second is twice as large as the first, and turned by 90 degrees.
    assert frames[:2] == pytest.approx([1, 2j], abs=1e-6)
    assert np.abs(frames[2]) == pytest.approx(2 ** (255 / 32))
    assert np.angle(frames[3], deg=True) == pytest.approx(129 / 256 * 360 - 360, abs=1e-4)


def test_bytes_are_those_of_the_arrays_and_the_object():
    found = quantize(FEATURES)
    assert len(found) == 4 and found.nbytes == 640 + 4 * (2 * 2 + 1 + 1 + 1)
    empty = CompactKeypoints(*(np.empty((0, 2), np.uint8),) * 4, 1.0)
    assert len(empty) == 0 and empty.nbytes == 640
