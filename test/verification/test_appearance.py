# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which cells are compared, what follows from a path of them, and what background they have."""

from __future__ import annotations

from collections.abc import Sequence

from hdc_place_recognition.database.base import Keyframe, Query
from hdc_place_recognition.features.cells import CellEncoder, Cells
from hdc_place_recognition.verification import appearance
from hdc_place_recognition.verification.appearance import (
    CellComparison,
    follow_path,
    learn_own_background,
)
from hdc_place_recognition.verification.path import PathMatch
from hdc_place_recognition.verification.settings import VerificationSettings
from hdc_place_recognition.verification.state import VerificationState
import numpy as np
import pytest

COUNT = 40
MAP = np.arange(COUNT)


def cells(seed: int, change: float = 0.0, season: int = 0) -> Cells:
    """Return the cells of a place, changed by a season."""
    grids = [
        np.random.default_rng(number).standard_normal((6, 8, 32), np.float32)
        for number in (seed, 1000 + season)
    ]
    return CellEncoder().encode(grids[0] + np.float32(change) * grids[1])


class Line:
    """Keyframes of one traverse, each of a place of its own."""

    def __init__(self, count: int = COUNT, with_cells: bool = True) -> None:
        self.cells = [cells(place) if with_cells else None for place in range(count)]

    def get(self, keyframe_id: int) -> Keyframe:
        return Keyframe(0, 0, np.zeros(4, np.float32), cells=self.cells[keyframe_id])

    def distance(self, first_id: int, second_id: int) -> int:
        return abs(first_id - second_id)

    def near(self, keyframe_id: int, radius: int) -> tuple[int, ...]:
        ids = range(max(keyframe_id - radius, 0), min(keyframe_id + radius + 1, len(self.cells)))
        return tuple(found for found in ids if found != keyframe_id)


@pytest.fixture(scope='module')
def line() -> Line:
    return Line()


def state() -> VerificationState:
    return VerificationState.new(VerificationSettings(), 1)


def comparison(line: Line, place: int, novelty: float = 1.0) -> CellComparison:
    """Compare a place as it looks in another season."""
    query = Query(
        0, np.ones((1, 4), np.float32), cells=cells(place, 0.7, place), traverse=1, novelty=novelty
    )
    return CellComparison(query, line)


def walk(
    line: Line,
    places: Sequence[int],
    *,
    miss: int = 0,
    novelty: float = 1.0,
    visits: np.ndarray = MAP,
) -> list[PathMatch | None]:
    """Follow places of which the database proposes a neighbor, and a wrong one."""
    followed, before = [], state()
    for index, place in enumerate(places):
        proposals = [(7 * index + 3) % COUNT, min(place + miss, COUNT - 1)]
        compared = comparison(line, place, novelty)
        followed.append(follow_path(compared, proposals, visits, before))
    return followed


def probabilities(found: list[PathMatch | None]) -> list[float]:
    return [0.0 if match is None else match.probability for match in found]


def test_a_path_of_another_season_is_found(line):
    found = walk(line, range(8, 18))
    assert [match.keyframe_id for match in found] == [*range(8, 18)]
    assert found[0].probability < 0.95 < found[-1].probability


def test_neighbors_of_the_best_are_compared_until_the_place_is_found(line):
    found = walk(line, range(8, 18), miss=1)
    assert [match.keyframe_id for match in found] == [*range(8, 18)]


def test_a_path_goes_on_without_proposals(line):
    before = state()
    for place in range(8, 16):
        follow_path(comparison(line, place), [place], MAP, before)
    match = follow_path(comparison(line, 16), [], MAP, before)
    assert match.keyframe_id == 16 and match.probability > 0.95


@pytest.mark.parametrize(
    'places', [[*range(30, 12, -1)], [20] * 18, [5, 30, 12, 38, 21, 2, 33, 17]]
)
def test_backwards_standing_and_jumping_are_no_path(line, places):
    assert max(probabilities(walk(line, places))) < 0.95


def test_images_that_show_little_new_are_no_path(line):
    assert max(probabilities(walk(line, range(8, 14), novelty=0.1))) < 0.95


def test_unknown_places_are_no_path(line):
    assert max(probabilities(walk(line, range(500, 520)))) < 0.95


def test_only_other_visits_are_compared(line):
    assert walk(line, range(8, 14), visits=np.arange(0)) == [None] * 6
    before, compared = state(), comparison(line, 10)
    assert follow_path(compared, [10, 11, 20], np.arange(20, COUNT), before) is not None
    # Of the keyframes that are no other visit none is compared.
    assert compared._known and min(compared._known) >= 20
    assert follow_path(comparison(line, 10), [10], np.arange(20, COUNT), state()) is None


def test_few_keyframes_are_compared(line):
    before = state()
    for place in range(8, 16):
        compared = comparison(line, place)
        follow_path(compared, [place, 3, 30], MAP, before)
        # Proposals, what lies ahead of two paths, neighbors, and two at random.
        assert len(compared._known) <= 3 + 6 + 6 + 2


def test_a_pair_is_compared_once(line, monkeypatch):
    calls, unpack = [], Cells.unpack
    monkeypatch.setattr(Cells, 'unpack', lambda packed: (calls.append(1), unpack(packed))[1])
    compared = comparison(line, 5)
    assert compared.possible and compared.of(5) == compared.of(5) > 3 * compared.of(9)
    # The image itself, and two keyframes.
    assert len(calls) == 3
    assert compared.between(5, 5) == pytest.approx(2, abs=1e-5) and compared.between(5, 9) < 0.5


def test_without_cells_nothing_is_alike():
    bare, query = Line(3, with_cells=False), Query(0, np.ones((1, 4), np.float32))
    compared = CellComparison(query, bare)
    assert not compared.possible and compared.of(0) == compared.between(0, 1) == 0
    compared = comparison(bare, 0)
    assert compared.possible and compared.of(0) == 0


def test_the_background_is_learned_from_far_keyframes_only(line, monkeypatch):
    before, learned = state(), []
    monkeypatch.setattr(before.background, 'update', learned.append)
    monkeypatch.setattr(appearance, '_RANDOM', 200)
    compared = comparison(line, 10)
    follow_path(compared, [10], MAP, before)
    near = {compared.of(found) for found in range(5, 16)}
    assert not near & {*learned} and 100 < len(learned) < 200
    assert {*learned} == {compared.of(found) for found in (*range(5), *range(16, COUNT))}


def test_a_traverse_learns_the_background_from_its_own_keyframes(line):
    before, mean = state(), state().background.mean
    for place in range(400, 460):
        learn_own_background(comparison(line, place), MAP, before)
    expected = np.mean([comparison(line, 400 + found).of(found) for found in range(20)])
    assert before.background.mean == pytest.approx(expected, rel=0.15)
    assert abs(before.background.mean - mean) > 0.02
    # Too few, or no cells.
    unchanged = state()
    learn_own_background(comparison(line, 400), MAP[:9], unchanged)
    learn_own_background(
        CellComparison(Query(0, np.ones((1, 4), np.float32)), line), MAP, unchanged
    )
    assert unchanged.background.mean == mean


def test_the_same_traverse_draws_the_same_keyframes(line):
    assert walk(line, range(8, 14)) == walk(line, range(8, 14))
