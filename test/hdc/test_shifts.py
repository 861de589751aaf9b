# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The grid of shifts, its groups, and what shifts do to positions: by hand."""

from hdc_place_recognition.hdc.shifts import NO_SHIFTS, Shifts
import numpy as np
import pytest


def test_offsets_are_row_by_row_around_the_zero_shift():
    shifts = Shifts(3, 1, 0.25)
    assert shifts.x.tolist() == [-0.25, 0, 0.25] and shifts.y.tolist() == [0]
    assert Shifts(1, 5, 0.5).y.tolist() == [-1, -0.5, 0, 0.5, 1]
    assert Shifts(3, 3, 1).offsets.tolist() == [
        [-1, -1], [0, -1], [1, -1], [-1, 0], [0, 0], [1, 0], [-1, 1], [0, 1], [1, 1],
    ]  # fmt: skip


@pytest.mark.parametrize(
    ('counts', 'zero'), [((1, 1), 0), ((3, 1), 1), ((1, 5), 2), ((5, 3), 7), ((9, 9), 40)]
)
def test_the_zero_shift_is_in_the_middle(counts, zero):
    shifts = Shifts(*counts, 0.1)
    assert shifts.zero == zero and shifts.offsets[zero].tolist() == [0, 0]


def test_positions_are_shifted_by_shares_of_width_and_height():
    shifts = Shifts(3, 5, 0.25)
    at = np.array([10, 20], np.float32)
    assert shifts.shift_x(at, 80).tolist() == [[-10, 0], [10, 20], [30, 40]]
    assert shifts.shift_y(at, 40).tolist() == [[-10, 0], [0, 10], [10, 20], [20, 30], [30, 40]]
    assert NO_SHIFTS.shift_x(at, 80).tolist() == [[10, 20]]


def test_groups_are_blocks_of_three_that_overlap_by_one():
    assert Shifts(5, 1, 0.1).groups == ((0, 1, 2), (2, 3, 4))
    assert Shifts(1, 7, 0.1).groups == ((0, 1, 2), (2, 3, 4), (4, 5, 6))
    # 3 columns: rows 0 to 2, and rows 2 to 4.
    assert Shifts(3, 5, 0.1).groups == (tuple(range(9)), tuple(range(6, 15)))
    assert Shifts(5, 3, 0.1).groups[1] == (2, 3, 4, 7, 8, 9, 12, 13, 14)


def test_the_remedy_for_an_even_count_is_named():
    with pytest.raises(ValueError, match=r'count_y 4 is even.*use 3 or 5'):
        Shifts(1, 4, 0.1)
