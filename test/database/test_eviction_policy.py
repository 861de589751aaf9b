# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The rows that the policy finds redundant, by hand: rows are points on a line or in a plane."""

from __future__ import annotations

from hdc_place_recognition.database import eviction
from hdc_place_recognition.database.eviction import Capacity, RedundancyPolicy
import numpy as np
import pytest


class Rows:
    """Vectors of rows with their ids, and the policy that watches over them."""

    def __init__(self, *vectors: tuple[float, ...]) -> None:
        self.vectors: list[np.ndarray] = []
        self.ids: list[int] = []
        self.policy = RedundancyPolicy(lambda row: self.vectors[row])
        for vector in vectors:
            self.add(vector)

    def add(self, vector: tuple[float, ...], twin: int | None = None) -> None:
        self.vectors.append(np.array(vector, np.float32))
        self.ids.append(self.ids[-1] + 1 if self.ids else 0)
        twin_row = self.ids.index(twin) if twin in self.ids else None
        self.policy.add(self.vectors[-1], twin, twin_row)

    def evict(self, row: int) -> None:
        self.policy.evict(row, self.ids[row])
        del self.vectors[row], self.ids[row]


@pytest.mark.parametrize(
    ('capacity', 'limited', 'keyframes', 'nbytes', 'exceeded'),
    [
        (Capacity(), False, 10**9, 10**12, False),
        (Capacity(3), True, 3, 10**12, False),
        (Capacity(3), True, 4, 0, True),
        (Capacity(megabytes=2.0), True, 10**9, 2_000_000, False),
        (Capacity(megabytes=2.0), True, 0, 2_000_001, True),
        (Capacity(3, 2.0), True, 4, 0, True),
        (Capacity(3, 2.0), True, 0, 2_000_001, True),
        (Capacity(1, 0.5), True, 1, 500_000, False),
    ],
)
def test_capacity_is_exceeded_by_more_than_it(capacity, limited, keyframes, nbytes, exceeded):
    assert bool(capacity) is limited
    assert capacity.exceeded(keyframes, nbytes) is exceeded


def test_rows_are_alike_from_the_threshold(monkeypatch):
    monkeypatch.setattr(eviction, 'SAME_PLACE', 0.5)
    assert Rows((1, 0), (0.5, 1)).policy.most_redundant() == 0
    assert Rows((1, 0), (0.4375, 1)).policy.most_redundant() is None
    assert Rows((1, 0)).policy.most_redundant() is None


def test_of_two_neighbors_the_one_more_like_its_other_neighbor_goes():
    # Products of neighbors: .5, .9, .4, so 1 and 2 are the pair, and 1 is more like 0.
    assert Rows((0.5, 0), (1, 0), (0.9, 1), (0, 0.4)).policy.most_redundant() == 1
    assert Rows((0.4, 0), (1, 0), (0.9, 1), (0, 0.5)).policy.most_redundant() == 2


def test_an_end_is_less_like_its_other_side_than_an_opposite_is():
    # 0 and 1 are the pair. Nothing is before 0; 2 is nearly the opposite of 1.
    assert Rows((1, 0), (1, 0), (-0.75, 0)).policy.most_redundant() == 1


def test_of_twins_the_newer_one_goes():
    rows = Rows((1, 0), (0, 0))
    rows.add((0.75, 1), twin=0)
    assert rows.policy.most_redundant() == 2
    rows.add((0, 1))
    # 3 is as like 2 as 1 would be: 1.0 is more than the 0.75 of the twins.
    assert rows.policy.most_redundant() == 2


def test_an_unknown_twin_is_none():
    rows = Rows((1, 0), (0, 0))
    rows.add((1, 0), twin=9)
    assert rows.policy.most_redundant() is None


@pytest.mark.parametrize(('evicted', 'left'), [(0, None), (1, 0), (2, None)])
def test_the_neighbors_of_an_evicted_row_become_neighbors(evicted, left):
    # Only 0 and 2 are alike, and nothing stands between them once 1 is gone.
    rows = Rows((1, 0), (0, 1), (1, 0))
    rows.evict(evicted)
    assert rows.policy.most_redundant() == left


def test_the_last_row_leaves_no_neighbor_behind():
    rows = Rows((1, 0), (0, 0), (1, 0), (1, 0))
    rows.evict(3)
    assert rows.policy.most_redundant() is None
    rows.add((1, 0))
    # The same distance from both: the first of the pair.
    assert rows.policy.most_redundant() == 2


def test_twins_of_an_evicted_row_are_orphans_and_others_are_not():
    rows = Rows((1, 0, 0), (0, 0, 0), (0, 1, 0), (0, 0, 0))
    for twin in (0, 2, 0):
        rows.add((float(twin == 0), float(twin == 2), 0), twin=twin)
        rows.add((0, 0, 0))
    rows.evict(0)
    # Of rows 3, 5 and 7 only 5 is left with its twin.
    assert rows.ids[rows.policy.most_redundant()] == 6
    rows.evict(rows.ids.index(6))
    assert rows.policy.most_redundant() is None


def test_bytes_of_a_row():
    assert Rows().policy.row_nbytes == 0 and Rows((1, 0)).policy.row_nbytes == 24
