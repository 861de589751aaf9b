# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which rows two stages compare exactly, and what they answer for the others: all by hand."""

from __future__ import annotations

from hdc_place_recognition.database import search, sign_index
from hdc_place_recognition.database.search import CenteredQuery, search_in_two_stages
from hdc_place_recognition.database.vector_store import SlotOrder, VectorStore
import numpy as np
from numpy.typing import NDArray
import pytest

NONE = np.empty(0, np.intp)
# Signs in which each row differs from the query, of 64.
DIFFERING = [40, 28, 26, 24, 2, 22, 20, 4, 18, 5, 3, 14]


def row(*differing: int) -> NDArray[np.float32]:
    """Return 64 elements for each number, the first ones -1 and the others 1."""
    return np.concatenate([np.repeat(np.float32([-1, 1]), [n, 64 - n]) for n in differing])


def stored(rows: list[NDArray[np.float32]], moved: bool) -> tuple[VectorStore, SlotOrder]:
    """Return rows in slots; if moved, one before them was removed and the last is in its slot."""
    store, order = VectorStore(len(rows[0])), SlotOrder()
    for vector in [-rows[0]] * moved + rows:
        store.add(vector, np.zeros(len(vector), np.float32))
        order.append()
    if moved:
        store.remove(0)
        order.remove(0)
    return store, order


def query(dimensions: int, shifts: int = 1) -> CenteredQuery:
    """Return a query of ones under the zero shift and -1 under all others, without means."""
    vectors = -np.ones((shifts, dimensions), np.float32)
    vectors[shifts // 2] = 1
    return CenteredQuery(vectors, np.zeros((shifts, dimensions)))


def exact(differing: float, dimensions: int = 64) -> float:
    return 1 - 2 * differing / dimensions


def estimate(differing: float, dimensions: int = 64) -> float:
    return float(np.cos(np.pi * differing / dimensions))


@pytest.mark.parametrize('moved', [False, True])
def test_nearest_spaced_and_adjacent_rows_are_compared(monkeypatch, moved):
    monkeypatch.setattr(search, '_NEAREST', 3)
    monkeypatch.setattr(search, '_SPACED', 3)
    monkeypatch.setattr(search, '_BEST', 1)
    store, order = stored([row(differing) for differing in DIFFERING], moved)
    found = search_in_two_stages(store, order, 12, query(64, 3), ((1,),), NONE)
    expected = [estimate(differing) for differing in DIFFERING]
    # The nearest: 4, 10, 7. Evenly spaced: 0, 5, 11. Beside the best one: 3 (and 5).
    for index in (3, 4, 5, 7, 10, 11):
        expected[index] = exact(DIFFERING[index])
    # Row 0 is more like the query under another shift.
    expected[0] = -exact(40)
    # No estimate is above the nearest rows, of which 7 is the last.
    expected[9] = exact(4)
    assert found.values == pytest.approx(expected, abs=1e-6)
    assert found.shifts.tolist() == [0, *[1] * 11]
    assert found.sample == pytest.approx([-exact(40), exact(22), exact(14)])


@pytest.mark.parametrize('best', [0, 11])
def test_rows_beside_the_best_at_an_end(monkeypatch, best):
    monkeypatch.setattr(search, '_NEAREST', 1)
    monkeypatch.setattr(search, '_SPACED', 1)
    monkeypatch.setattr(search, '_BEST', 1)
    differing = [20] * 12
    differing[best] = 1
    store, order = stored([row(number) for number in differing], False)
    found = search_in_two_stages(store, order, 12, query(64), ((0,),), NONE)
    compared = np.flatnonzero(np.isclose(found.values, [exact(number) for number in differing]))
    # Row 0 is the only evenly spaced one.
    assert compared.tolist() == ([0, 1] if best == 0 else [0, 10, 11])


def test_rows_that_are_asked_for_are_compared_too(monkeypatch):
    for name in ('_NEAREST', '_SPACED', '_BEST'):
        monkeypatch.setattr(search, name, 1)
    store, order = stored([row(differing) for differing in DIFFERING], False)
    found = search_in_two_stages(store, order, 12, query(64), ((0,),), np.array([2, 9]))
    compared = np.isclose(found.values, [exact(differing) for differing in DIFFERING])
    # Row 0 is evenly spaced; 3 and 5 are beside 4, the nearest.
    assert np.flatnonzero(compared).tolist() == [0, 2, 3, 4, 5, 9]
    # They are no sample of all rows.
    assert found.sample == pytest.approx([exact(40)])


def test_only_a_prefix_is_searched():
    store, order = stored([row(differing) for differing in DIFFERING], True)
    found = search_in_two_stages(store, order, 4, query(64), ((0,),), NONE)
    assert found.values == pytest.approx([exact(differing) for differing in DIFFERING[:4]])


def test_coarse_signs_choose_which_rows_all_signs_are_compared_of(monkeypatch):
    for name, value in {'_ALL_SIGNS': 11, '_SHARE': 3, '_LEAST': 2}.items():
        monkeypatch.setattr(search, name, value)
    for name, value in {'_NEAREST': 2, '_SPACED': 1, '_BEST': 0}.items():
        monkeypatch.setattr(search, name, value)
    monkeypatch.setattr(sign_index, '_COARSE_WORDS', 1)
    coarse = [32, 30, 9, 28, 6, 26, 7, 24, 8, 22, 20, 18]
    rest = [10, 0, 0, 10, 20, 10, 12, 10, 30, 10, 10, 10]
    store, order = stored([row(*pair) for pair in zip(coarse, rest, strict=True)], True)
    found = search_in_two_stages(store, order, 12, query(128), ((0,),), NONE)
    expected = [estimate(differing) for differing in coarse]
    # A third of 12 rows: 2, 4, 6, 8 have the nearest coarse signs; of these 2 and 6 are nearest.
    expected[4], expected[8] = estimate(26, 128), estimate(38, 128)
    expected[0], expected[2], expected[6] = exact(42, 128), exact(9, 128), exact(19, 128)
    expected = [min(value, exact(19, 128)) if index != 2 else value
                for index, value in enumerate(expected)]  # fmt: skip
    assert found.values == pytest.approx(expected, abs=1e-6)


def test_at_least_some_rows_are_compared_by_all_signs(monkeypatch):
    for name, value in {'_ALL_SIGNS': 11, '_SHARE': 12, '_LEAST': 2, '_NEAREST': 2}.items():
        monkeypatch.setattr(search, name, value)
    monkeypatch.setattr(search, '_SPACED', 1)
    monkeypatch.setattr(search, '_BEST', 0)
    monkeypatch.setattr(sign_index, '_COARSE_WORDS', 1)
    pairs = [(20, 0), *[(30, 0)] * 9, (4, 40), (6, 1)]
    store, order = stored([row(*pair) for pair in pairs], False)
    found = search_in_two_stages(store, order, 12, query(128), ((0,),), NONE)
    assert found.values[[10, 11]] == pytest.approx([exact(44, 128), exact(7, 128)])


def test_all_signs_are_compared_up_to_a_number_of_rows(monkeypatch):
    for name, value in {'_ALL_SIGNS': 3, '_SHARE': 3, '_LEAST': 1, '_NEAREST': 1}.items():
        monkeypatch.setattr(search, name, value)
    monkeypatch.setattr(search, '_SPACED', 1)
    monkeypatch.setattr(search, '_BEST', 0)
    monkeypatch.setattr(sign_index, '_COARSE_WORDS', 1)
    # By the coarse signs row 1 is nearest, by all signs row 2 is.
    store, order = stored([row(20, 20), row(4, 40), row(6, 1)], False)
    found = search_in_two_stages(store, order, 3, query(128), ((0,),), NONE)
    assert found.values[2] == pytest.approx(exact(7, 128))


def test_cosines_are_centered_and_0_without_direction():
    means = np.array([[0, 0], [1, 0]], np.float64)
    asked = CenteredQuery(np.array([[0, 0], [1, 2]], np.float32), means)
    assert asked.zero_shift == 1
    assert asked.centered.tolist() == [[0, 0], [0, 2]]
    assert asked.probes().tolist() == [[0, 0], [0, 2], [1, 0]]
    rows = np.array([[1, 3], [4, 4], [1, 0]], np.float32)
    squares = np.square(rows, dtype=np.float64).sum(axis=1)
    values, shifts = asked.cosines(rows @ asked.probes().T, squares)
    # Without the mean the rows are (0, 3), (3, 4) and (0, 0).
    assert values == pytest.approx([1, 0.8, 0]) and shifts.tolist() == [1, 1, 0]
