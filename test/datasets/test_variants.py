# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Variants of a dataset, and their ground truth."""

from conftest import texture
from hdc_place_recognition.datasets.dataset import Truth
from hdc_place_recognition.datasets.ground_truth import MatrixTruth
from hdc_place_recognition.datasets.variants import (
    AloneTruth,
    First,
    NothingInCommon,
    Reversed,
    ReversedTruth,
    Rolled,
    Shifted,
    SwappedTruth,
    Thinned,
    turn,
    Zoomed,
)
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.results import Frame
import numpy as np
import pytest

S = 10**9
ALL = range(1000)


def frames(*images):
    return [Frame(index * S, image) for index, image in enumerate(images)]


def textures(count):
    return frames(*(texture(seed) for seed in range(count)))


def stamps(source):
    return [frame.stamp_ns // S for frame in source]


def equal(first, second):
    return all(
        before.stamp_ns == after.stamp_ns and np.array_equal(before.image, after.image)
        for before, after in zip(first, second, strict=True)
    )


def matrix_truth(hard, soft=None):
    hard = np.array(hard, bool)
    times = [np.arange(size) * S for size in hard.shape]
    return MatrixTruth(Truth(hard, hard if soft is None else np.array(soft, bool)), *times)


def test_angles_are_within_the_range_and_of_either_sign():
    angles = np.array([Rolled([], 15, 30, 0, ALL).angle(index) for index in range(200)])
    assert np.abs(angles).min() >= 15 and np.abs(angles).max() <= 30
    assert 60 < (angles > 0).sum() < 140
    assert len(set(angles.tolist())) == 200


def test_same_seed_same_images():
    source = textures(4)
    rolled = Rolled(source, 15, 30, 1, ALL)
    assert equal(rolled, rolled) and equal(rolled, Rolled(source, 15, 30, 1, ALL))
    assert not equal(rolled, Rolled(source, 15, 30, 2, ALL))


@pytest.mark.parametrize('shape', [(40, 80), (80, 40, 3), (33, 33)])
def test_rolled_images_have_no_black_corners(shape):
    white = frames(*[np.full(shape, 255, np.uint8)] * 8)
    for frame in Rolled(white, 30, 90, 0, ALL):
        assert frame.image.shape == shape and frame.image.min() == 255


def test_only_the_chosen_images_are_changed():
    source = textures(5)
    for variant in (
        Rolled(source, 15, 30, 0, {1, 3}),
        Zoomed(source, 1.5, {1, 3}),
        Shifted(source, {1, 3}),
    ):
        assert len(variant) == 5 and stamps(variant) == [0, 1, 2, 3, 4]
        changed = [
            not np.array_equal(before.image, after.image)
            for before, after in zip(source, variant, strict=True)
        ]
        assert changed == [False, True, False, True, False]


def test_turn_by_right_angles_is_exact():
    image = texture(0, 33, 33)
    assert np.array_equal(turn(image, 90), np.rot90(image))
    assert np.array_equal(turn(image, 180), image[::-1, ::-1])
    assert np.array_equal(turn(image, 0), image)


def test_zoom_enlarges_about_the_middle():
    image = np.zeros((41, 61), np.uint8)
    image[15:26, 25:36] = 255
    (larger,) = Zoomed(frames(image), 2.0, ALL)
    (smaller,) = Zoomed(frames(image), 0.5, ALL)
    middles = [frame.image[20, 15:46] >= 200 for frame in (larger, smaller)]
    assert [int(row.sum()) for row in middles] == [21, 5]
    for row in middles:
        assert np.array_equal(row, row[::-1])


def test_zoomed_out_border_is_mirrored_not_black():
    (frame,) = Zoomed(frames(np.full((20, 30), 200, np.uint8)), 0.6, ALL)
    assert frame.image.min() == 200


def test_shift_shows_the_left_or_the_right_two_thirds():
    ramp = np.tile(np.arange(0, 180, 2, dtype=np.uint8), (60, 1))
    borders = [
        (int(frame.image[30, 0]), int(frame.image[30, -1]))
        for frame in Shifted(frames(*[ramp] * 20), ALL)
    ]
    assert set(borders) == {(0, 118), (60, 178)}


def test_thinned_images_keep_their_stamps():
    source = textures(7)
    assert stamps(Thinned(source, 3)) == [0, 3, 6] and len(Thinned(source, 3)) == 3
    assert equal(Thinned(source, 1), source)
    times = np.array(stamps(Thinned(source, 3))) * S
    found = matrix_truth(np.eye(7)).truth(times, times)
    assert np.array_equal(found.hard, np.eye(3))


def test_first_images():
    source = textures(5)
    assert stamps(First(source, 2)) == [0, 1] and len(First(source, 2)) == 2
    assert len(First(source, 9)) == len(list(First(source, 9))) == 5


def test_reversed_images_have_rising_stamps_and_mirrored_intervals():
    source = [Frame(stamp, texture(stamp)) for stamp in (10, 20, 50)]
    backwards = list(Reversed(source, 60))
    assert [frame.stamp_ns for frame in backwards] == [10, 40, 50]
    assert np.array_equal(backwards[0].image, source[2].image)
    assert equal(Reversed(backwards, 60), source)


def test_truth_of_a_reversed_sequence_holds_in_both_directions():
    hard = np.zeros((4, 4))
    hard[3, 0] = 1  # the last image shows the first place again
    truth = ReversedTruth(matrix_truth(hard, np.maximum(hard, np.eye(4))), 3 * S, True)
    times = np.arange(4) * S
    found = truth.truth(times, times)
    expected = np.zeros((4, 4))
    expected[3, 0] = expected[0, 3] = 1
    assert np.array_equal(found.hard, expected)
    assert np.array_equal(found.soft, np.maximum(expected, np.eye(4)))


def test_truth_of_reversed_queries():
    hard = [[1, 0, 0], [0, 0, 1]]
    truth = ReversedTruth(matrix_truth(hard), S, False)
    found = truth.truth(np.array([0, 1]) * S, np.arange(3) * S)
    assert np.array_equal(found.hard, hard[::-1])


def test_truth_of_swapped_traverses():
    hard = np.array([[1, 0, 0], [0, 0, 1]])
    found = SwappedTruth(matrix_truth(hard)).truth(np.arange(3) * S, np.arange(2) * S)
    assert np.array_equal(found.hard, hard.T) and np.array_equal(found.soft, hard.T)


def test_images_of_one_traverse_that_match_one_query_are_ignored():
    # Query 0 shows the first two images of the map, query 1 the last one.
    truth = AloneTruth(matrix_truth(np.zeros((2, 3)), [[1, 1, 0], [0, 0, 1]]), np.arange(2) * S)
    found = truth.truth(np.array([1, 2]) * S, np.arange(3) * S)
    assert not found.hard.any()
    assert np.array_equal(found.soft, [[1, 1, 0], [0, 0, 1]])


def test_nothing_in_common():
    found = NothingInCommon().truth(np.arange(2), np.arange(3))
    assert found.hard.shape == found.soft.shape == (2, 3)
    assert not found.hard.any() and not found.soft.any()


@pytest.mark.parametrize(
    'make',
    [
        lambda: Rolled([], 30, 15, 0, ALL),
        lambda: Rolled([], -5, 15, 0, ALL),
        lambda: Zoomed([], 0, ALL),
        lambda: Thinned([], 0),
    ],
)
def test_values_out_of_range_are_refused(make):
    with pytest.raises(PlaceRecognitionError, match=r'roll|zoom|thin'):
        make()


def test_summaries_name_the_variant():
    truth = matrix_truth(np.eye(2))
    assert ReversedTruth(truth, S, True).summary.endswith('reversed')
    assert SwappedTruth(truth).summary.endswith('swapped')
    assert AloneTruth(truth, np.arange(2)).summary == 'nothing is revisited'
