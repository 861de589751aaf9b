# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The rules of the verifier, each on evidence made by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace

from hdc_place_recognition.database.base import Background, Keyframe, Match, Query, SearchResult
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.results import Candidate, NOT_VERIFIED, Reason
from hdc_place_recognition.verification import verifier
from hdc_place_recognition.verification.appearance import CellComparison
from hdc_place_recognition.verification.geometry import Geometry
from hdc_place_recognition.verification.path import PathMatch
from hdc_place_recognition.verification.scoring import Scorer
from hdc_place_recognition.verification.settings import Calibration, VerificationSettings
from hdc_place_recognition.verification.state import VerificationState
from hdc_place_recognition.verification.verifier import CandidateVerifier
import numpy as np
import pytest

SETTINGS = VerificationSettings()
SCORER = Scorer(SETTINGS, Calibration(2.0, 1.5), Calibration(4.0, -2.0))
PARAMS = Params(min_score=0.9, top_k=50, verify_top_k=5)
NONE = np.empty(0, np.int64)


class Line:
    """Keyframes of traverses one after the other; the first ids are of traverse 0."""

    def __init__(self, *lengths: int) -> None:
        self.traverses = np.repeat(np.arange(len(lengths)), lengths).tolist()

    def get(self, keyframe_id: int) -> Keyframe:
        stamp_ns, traverse = 10 * keyframe_id, self.traverses[keyframe_id]
        keypoints = SimpleNamespace(number=keyframe_id)
        return Keyframe(stamp_ns, stamp_ns, np.zeros(4, np.float32), keypoints, traverse=traverse)

    def distance(self, first_id: int, second_id: int) -> int | None:
        same = self.traverses[first_id] == self.traverses[second_id]
        return abs(first_id - second_id) if same else None

    def near(self, keyframe_id: int, radius: int) -> tuple[int, ...]:
        ids = range(max(keyframe_id - radius, 0), keyframe_id + radius + 1)
        return tuple(
            found
            for found in ids
            if found != keyframe_id
            and found < len(self.traverses)
            and self.traverses[found] == self.traverses[keyframe_id]
        )


class World:
    """
    What one image has in common with the keyframes.

    :param inliers: of each keyframe, 0 for all others.
    """

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        inliers: Mapping[int, int],
        lengths: Sequence[int] = (100,),
    ) -> None:
        self.inliers = inliers
        self.matches: dict[int, Match] = {}
        self.cells: dict[int, float] = {}
        self.alike: set[tuple[int, int]] = set()
        self.spread = 9
        self.path: PathMatch | None = None
        self.asked_for_path = 0
        self.verified: list[int] = []
        self.searched = sum(lengths)
        self.verifier = CandidateVerifier(Line(*lengths), np.zeros((1, 2), np.float32), SCORER)
        self.state = VerificationState.new(SETTINGS, 0)
        monkeypatch.setattr(verifier, 'verify_geometry', self.geometry)
        monkeypatch.setattr(verifier, 'follow_path', self.follow_path)
        monkeypatch.setattr(CellComparison, 'of', lambda _, found: self.cells.get(found, 0.0))
        monkeypatch.setattr(CellComparison, 'between', lambda _, a, b: float((a, b) in self.alike))

    def geometry(self, _: object, keyframe: SimpleNamespace, *rest: object) -> Geometry:
        self.verified.append(keyframe.number)
        inliers = self.inliers.get(keyframe.number, 0)
        return Geometry(inliers=inliers, spread=self.spread if inliers else 0, shift_x=0.25)

    def follow_path(self, *given: object) -> PathMatch | None:
        self.asked_for_path += 1
        return self.path

    def match(self, keyframe_id: int) -> Match:
        return self.matches.get(keyframe_id, Match(keyframe_id, 0.3, 0, distinctness=3.0))

    def ask(
        self,
        proposed: Sequence[int],
        by_words: Sequence[int] = (),
        *,
        moved: bool = True,
        cells: bool = True,
        other_visits: np.ndarray = NONE,
        **changes: object,
    ) -> dict[int, Candidate]:
        """Return the candidates of an image by the ids of their keyframes, best first."""
        query = Query(
            1000,
            np.ones((1, 4), np.float32),
            keypoints=SimpleNamespace(aspect=0.75),
            cells=SimpleNamespace() if cells else None,
            moved=moved,
        )
        result = SearchResult(
            matches=tuple(self.match(found) for found in proposed),
            by_words=tuple(self.match(found) for found in by_words),
            find=lambda found: self.match(found) if found < self.searched else None,
            background=Background(100),
        )
        params = PARAMS.replace(**changes)
        candidates = self.verifier.verify(query, result, self.state, None, params, other_visits)
        return {candidate.match_id: candidate for candidate in candidates}


# What is verified


def test_the_most_distinct_is_verified_then_what_cells_and_words_prefer(monkeypatch):
    world = World(monkeypatch, {})
    world.cells = {10: 0.1, 30: 0.5, 40: 0.9, 50: 0.7}
    world.ask([10, 20, 30, 40, 50], [70, 80, 90])
    assert world.verified[:5] == [10, 40, 50, 70, 80]
    assert len(world.verified) == len(set(world.verified))


def test_without_cells_the_more_distinct_are_verified(monkeypatch):
    world = World(monkeypatch, {})
    world.cells = {40: 0.9}
    world.ask([10, 20, 30, 40, 50], [70, 80, 90], cells=False)
    assert world.verified[:5] == [10, 20, 30, 70, 80]


def test_words_add_places_that_are_not_verified_yet(monkeypatch):
    world = World(monkeypatch, {})
    world.ask([10, 20, 30], [12, 20, 13, 14, 50], cells=False)
    # 12 and 13 are within three keyframes of 10.
    assert world.verified[:5] == [10, 20, 30, 14, 50]


@pytest.mark.parametrize(('count', 'expected'), [(1, [10]), (2, [10, 70]), (3, [10, 20, 70])])
def test_few_are_verified_if_wanted(monkeypatch, count, expected):
    world = World(monkeypatch, {10: 30})
    world.ask([10, 20, 30], [70, 80], cells=False, verify_top_k=count)
    # Beside them only the neighbors of the strongest.
    assert world.verified == [*expected, 9, 11]


def test_the_neighbors_of_the_strongest_are_climbed_three_times(monkeypatch):
    world = World(monkeypatch, {20: 10, 21: 20, 22: 40, 23: 80, 24: 160})
    found = world.ask([20, 60])
    assert set(world.verified) == {20, 60, *range(19, 24)}
    assert next(iter(found)) == 23 and found[23].accepted


@pytest.mark.parametrize(
    ('inliers', 'spread', 'stopped'), [(40, 8, True), (39, 16, False), (400, 7, False)]
)
def test_beyond_doubt_no_other_place_is_verified(monkeypatch, inliers, spread, stopped):
    world = World(monkeypatch, {20: inliers})
    world.spread = spread
    world.ask([10, 20, 60, 70], cells=False, verify_top_k=8)
    assert world.verified == [10, 20, *([] if stopped else [60, 70]), 19, 21]


def test_only_what_was_searched_is_verified(monkeypatch):
    world = World(monkeypatch, {20: 10, 21: 90})
    world.searched = 21
    assert set(world.ask([20])) == {20, 19} and 21 not in world.verified


def test_keyframes_next_to_the_last_certain_place_are_verified(monkeypatch):
    world = World(monkeypatch, {50: 60})
    world.ask([50])
    assert world.state.temporal.last == (50, pytest.approx(1, abs=0.01))
    world.inliers, world.verified = {}, []
    world.ask([10], cells=False)
    assert world.verified[:5] == [10, 50, 51, 53, 48]
    # That image was not certain.
    world.verified.clear()
    world.ask([10])
    assert not {50, 51, 53, 48} & set(world.verified)


@pytest.mark.parametrize(
    ('last', 'expected'), [(0, [0, 1, 3]), (1, [1, 2, 4, 0]), (98, [98, 99, 96])]
)
def test_what_is_next_ends_with_the_traverse(monkeypatch, last, expected):
    world = World(monkeypatch, {last: 60}, (100, 20))
    world.ask([last])
    world.verified.clear()
    world.inliers = {}
    world.ask([50], cells=False)
    end = len(expected) + 1
    assert world.verified[:end] == [50, *expected]


@pytest.mark.parametrize(('probability', 'looked'), [(0.31, True), (0.29, False)])
def test_the_last_place_must_be_certain_enough(monkeypatch, probability, looked):
    world = World(monkeypatch, {})
    world.state.temporal.remember(50, probability)
    world.ask([10])
    assert (50 in world.verified) is looked


# Rivals


def test_rivals_are_those_of_the_strongest_keyframe_of_a_place(monkeypatch):
    def score(strongest: float, beside: float) -> float:
        world = World(monkeypatch, {20: 4, 21: 3})
        for found, distinctness in ((20, strongest), (21, beside)):
            match = world.match(found)
            world.matches[found] = replace(match, rival_id=60, rival_distinctness=distinctness)
        return world.ask([20])[21].score

    assert score(2.0, 0.0) == score(2.0, 9.0) > score(9.0, 0.0)


def test_a_place_that_was_visited_before_is_no_rival(monkeypatch):
    def score(*links: tuple[int, int]) -> float:
        world = World(monkeypatch, {20: 14, 60: 13})
        world.matches[20] = replace(world.match(20), rival_id=60, rival_distinctness=3.0)
        for later, earlier in links:
            world.verifier.links.accept(later, earlier)
        return world.ask([20, 60])[20].score

    assert score() <= 0.5 and score((60, 20)) > 0.9
    assert score((60, 50)) <= 0.5


def test_inliers_at_another_place_count_against_it(monkeypatch):
    def best(rival: int) -> Candidate:
        return World(monkeypatch, {20: 30, 60: rival}).ask([20, 60])[20]

    assert best(0).score == best(7).score > best(15).score > best(22).score
    assert best(22).reason is Reason.ANOTHER_PLACE and best(22).score <= 0.5
    # Within ten keyframes it is the same place.
    near = World(monkeypatch, {20: 30, 30: 22}).ask([20, 30])
    assert near[20].score == best(0).score


def test_another_place_is_true_only_as_far_as_the_best_is_not(monkeypatch):
    found = World(monkeypatch, {20: 39, 60: 20}).ask([20, 60])
    assert found[20].accepted and not found[60].accepted
    assert found[60].score == pytest.approx(1 - found[20].score)
    assert found[60].reason is Reason.ANOTHER_PLACE


# Other keyframes of the place


@pytest.mark.parametrize(
    ('near', 'inliers', 'alike', 'accepted'),
    [(22, 20, True, True), (22, 19, True, False), (22, 38, False, False), (27, 38, True, False)],
)
def test_a_neighbor_with_the_same_view_is_accepted_too(
    monkeypatch, near, inliers, alike, accepted
):
    world = World(monkeypatch, {20: 39, near: inliers})
    world.cells = {20: 0.9}
    world.alike = {(near, 20)} if alike else set()
    found = world.ask([20, near])
    assert found[20].accepted and found[near].accepted is accepted
    assert accepted or found[near].score <= 0.5


@pytest.mark.parametrize(
    ('near', 'inliers', 'similarity', 'accepted'),
    [(21, 43, 0.9, True), (21, 41, 0.9, False), (21, 59, 0.7, False), (22, 59, 0.9, False)],
)
def test_the_keyframe_beside_is_accepted_if_cells_prefer_it(
    monkeypatch, near, inliers, similarity, accepted
):
    world = World(monkeypatch, {20: 60, near: inliers})
    world.cells = {20: 0.8, near: similarity}
    assert world.ask([20, near])[near].accepted is accepted


def test_none_is_accepted_with_a_best_that_is_not(monkeypatch):
    world = World(monkeypatch, {20: 5, 21: 5})
    world.alike = {(21, 20)}
    found = world.ask([20])
    assert not any(candidate.accepted for candidate in found.values())


# What comes out


def test_candidates_come_best_first_and_those_not_verified_last(monkeypatch):
    proposed = [10, 20, 30, 40, 50, 60, 70, 80, 90]
    found = World(monkeypatch, {30: 60}).ask(proposed, cells=False)
    scores = [candidate.score for candidate in found.values()]
    assert next(iter(found)) == 30 and scores == sorted(scores, reverse=True)
    rest = [*found.values()][-4:]
    assert [candidate.match_id for candidate in rest] == [60, 70, 80, 90]
    assert {candidate.reason for candidate in rest} == {Reason.NOT_VERIFIED}
    assert {(candidate.score, candidate.inliers) for candidate in rest} == {(0.0, NOT_VERIFIED)}


def test_no_more_candidates_than_wanted(monkeypatch):
    assert [*World(monkeypatch, {20: 60}).ask([20, 40, 60], top_k=1)] == [20]


def test_nothing_found_gives_no_candidate(monkeypatch):
    assert World(monkeypatch, {}).ask([]) == {}


def test_a_candidate_tells_its_inliers_shift_and_stamps(monkeypatch):
    found = World(monkeypatch, {20: 39}).ask([20, 60])
    assert (found[20].inliers, found[20].shift_x) == (39, 0.25)
    assert (found[60].inliers, found[60].shift_x) == (0, 0.0)
    assert (found[20].query_stamp_ns, found[20].match_stamp_ns) == (1000, 200)
    assert found[20].reason is Reason.ACCEPTED


# The images before


def test_images_before_support_a_candidate(monkeypatch):
    world = World(monkeypatch, {20: 9})
    alone = world.ask([20])[20].score
    for place in (18, 19):
        world.state.temporal.remember(place, 1.0)
    assert world.ask([20])[20].score > alone + 0.01


def test_an_image_that_shows_nothing_new_is_not_remembered(monkeypatch):
    world = World(monkeypatch, {20: 60})
    world.ask([20], moved=False)
    assert world.state.temporal.last is None
    world.ask([20])
    world.inliers = {60: 90}
    world.ask([60], moved=False)
    assert world.state.temporal.last[0] == 20


def test_an_image_of_two_places_is_remembered_as_uncertain(monkeypatch):
    world = World(monkeypatch, {20: 30, 60: 30})
    world.ask([20, 60])
    assert world.state.temporal.last[1] == pytest.approx(0.5, abs=0.05)


# Without geometry


def test_without_keypoints_only_the_best_can_be_the_place(monkeypatch):
    world = World(monkeypatch, {})
    matches = tuple(Match(found, 0.5, 0, distinctness=8.0) for found in (20, 60, 40))
    result = SearchResult(matches, background=Background(100))
    query = Query(0, np.ones((1, 4), np.float32))
    best, *rest = world.verifier.verify(query, result, world.state, None, PARAMS, NONE)
    assert best.match_id == 20 and best.accepted and best.inliers == NOT_VERIFIED
    assert best.score == pytest.approx(SCORER.unverified.score(np.log(0.5)))
    for candidate in rest:
        assert candidate.score == pytest.approx(1 - best.score)
        assert candidate.reason is Reason.ANOTHER_PLACE
    assert not world.verified


# Path evidence


SESSIONS = (50, 50)
OTHER = np.arange(50)


def path(keyframe_id: int, probability: float = 0.97) -> PathMatch:
    return PathMatch(keyframe_id, probability, 3.0, -3.0)


def test_the_keyframe_of_a_path_comes_first(monkeypatch):
    world = World(monkeypatch, {}, SESSIONS)
    world.path = path(30)
    found = world.ask([10, 20, 40], other_visits=OTHER)
    assert next(iter(found)) == 30 and found[30].accepted and found[30].score == 0.97
    assert found[30].inliers == NOT_VERIFIED
    assert sum(candidate.accepted for candidate in found.values()) == 1
    # One that was verified keeps its inliers.
    found = world.ask([10, 30], other_visits=OTHER)
    assert next(iter(found)) == 30 and found[30].accepted and found[30].inliers == 0


@pytest.mark.parametrize(('best', 'kept'), [(31, True), (32, True), (28, True), (33, False)])
def test_only_keyframes_beside_that_of_the_path_are_accepted_too(monkeypatch, best, kept):
    world = World(monkeypatch, {best: 60}, SESSIONS)
    world.path = path(30)
    found = world.ask([best], other_visits=OTHER)
    assert next(iter(found)) == 30 and found[30].accepted
    assert found[best].accepted is kept
    if not kept:
        assert found[best].score == 0.5 and found[best].reason is Reason.ANOTHER_PLACE


@pytest.mark.parametrize('best', [45, 60])
def test_keypoints_at_another_place_overrule_the_path(monkeypatch, best):
    world = World(monkeypatch, {best: 60}, SESSIONS)
    plain = world.ask([best], other_visits=OTHER)
    world.state = VerificationState.new(SETTINGS, 0)
    world.path = path(30)
    assert world.ask([best], other_visits=OTHER) == plain and plain[best].accepted


def test_a_path_below_the_threshold_or_not_searched_changes_nothing(monkeypatch):
    world = World(monkeypatch, {}, SESSIONS)
    world.path = path(30, 0.89)
    assert not any(found.accepted for found in world.ask([10], other_visits=OTHER).values())
    world.path, world.searched = path(30), 30
    assert 30 not in world.ask([10], other_visits=OTHER)


@pytest.mark.parametrize(
    'changes',
    [{'moved': False}, {'allow_appearance_closures': False}, {'other_visits': NONE}],
)
def test_when_a_path_is_not_asked_for(monkeypatch, changes):
    world = World(monkeypatch, {}, SESSIONS)
    world.path = path(30)
    found = world.ask([10], **{'other_visits': OTHER, **changes})
    assert world.asked_for_path == 0 and 30 not in found
    world.ask([10], other_visits=OTHER)
    assert world.asked_for_path == 1


# A new keyframe


def test_a_new_keyframe_is_linked_to_its_place_and_learns_from_its_traverse(monkeypatch):
    world, learned = World(monkeypatch, {}, (300, 300)), []
    monkeypatch.setattr(
        verifier, 'learn_own_background', lambda _, own, state: learned.append(own.tolist())
    )
    query = Query(0, np.ones((1, 4), np.float32))
    world.verifier.note_keyframe(query, 599, 20, world.state)
    # Of the last 200 the ten newest are left out.
    assert learned == [[*range(399, 589)]]
    world.verifier.note_keyframe(query, 305, None, world.state)
    assert learned[1] == []
    links, distance = world.verifier.links, Line(300, 300).distance
    assert not links.distinct(599, 20, distance) and links.distinct(305, 20, distance)
