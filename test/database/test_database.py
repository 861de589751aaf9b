# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What every keyframe database must answer: the one in memory, and the one of a list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from hdc_place_recognition.database.base import (
    Background,
    Keyframe,
    KeyframeDatabase,
    Match,
    Query,
)
from hdc_place_recognition.database.memory import MemoryDatabase
from hdc_place_recognition.database.vector_store import VectorStore
from hdc_place_recognition.features.cells import Cells
from hdc_place_recognition.features.compact import CompactKeypoints
from hdc_place_recognition.hdc.algebra import normalize
from list_database import ListDatabase
import numpy as np
from numpy.typing import NDArray
import pytest

SHIFTS, DIMENSIONS = 3, 64
Create = Callable[..., KeyframeDatabase]


def in_memory(center: bool = True, shifts: int = SHIFTS) -> KeyframeDatabase:
    return MemoryDatabase(VectorStore(DIMENSIONS), shifts, center)


def in_a_list(center: bool = True, shifts: int = SHIFTS) -> KeyframeDatabase:
    return ListDatabase(shifts, DIMENSIONS, center)


@pytest.fixture(params=[in_memory, in_a_list])
def create(request: pytest.FixtureRequest) -> Create:
    return request.param


def images(count: int, seed: int = 0, shifts: int = SHIFTS) -> list[Query]:
    """Return queries with a part that all of them share, which centering subtracts."""
    rng = np.random.default_rng(seed)
    common = rng.standard_normal((shifts, DIMENSIONS))
    own = rng.standard_normal((count, shifts, DIMENSIONS))
    vectors = normalize((own + common).astype(np.float32))
    return [Query(10 * index, vector) for index, vector in enumerate(vectors)]


def with_words(queries: list[Query], share: float = 0.8, seed: int = 0) -> list[Query]:
    """Return queries of which some have words; those that follow each other share a few."""
    rng = np.random.default_rng(seed)
    found = []
    for index, query in enumerate(queries):
        drawn = np.concatenate([rng.integers(0, 60, 20), 100 + 10 * index + np.arange(25)])
        words = np.unique(drawn).astype(np.int32) if rng.random() < share else None
        found.append(replace(query, words=words))
    return found


def keyframe(query: Query, traverse: int = 0) -> Keyframe:
    stamp_ns = query.stamp_ns
    return Keyframe(stamp_ns, stamp_ns, query.unshifted, words=query.words, traverse=traverse)


def filled(create: Create, queries: list[Query], *traverses: int, center: bool = True):
    database = create(center, len(queries[0].vectors))
    for index, query in enumerate(queries):
        database.update_mean(query)
        traverse = traverses[index % len(traverses)] if traverses else 0
        assert database.add(keyframe(query, traverse)).keyframe_id == index
    return database


def ids(matches) -> list[int]:
    return [match.keyframe_id for match in matches]


def expected(queries: list[Query], query: Query) -> tuple[NDArray, NDArray]:
    """Return similarities and shifts by the formula of the docstring, in float64."""
    vectors = np.array([earlier.vectors for earlier in queries], np.float64)
    means = vectors.mean(axis=0)
    rows, asked = vectors[:, SHIFTS // 2] - means[SHIFTS // 2], query.vectors - means
    table = rows @ asked.T / np.linalg.norm(rows, axis=1)[:, None]
    table = table / np.linalg.norm(asked, axis=1)
    return table.max(axis=1), table.argmax(axis=1)


def test_empty(create):
    found = create().search(images(1)[0], 5)
    assert found.matches == () and found.background == Background()
    assert len(create()) == 0 and create().evicted_count == 0


@pytest.mark.parametrize('count', [1, 2, 9, 40])
def test_centered_cosine_under_the_best_shift(create, count):
    queries = images(count + 1)
    database = filled(create, queries[:-1])
    found = database.search(queries[-1], count)
    if count > 1:  # the mean of one image is the image: no direction is left
        similarities, shifts = expected(queries[:-1], queries[-1])
        assert np.allclose(found.similarities, similarities, atol=1e-5)
        for match in found.matches:
            assert match.similarity == pytest.approx(similarities[match.keyframe_id], abs=1e-5)
            assert match.shift == shifts[match.keyframe_id]
    assert len(database) == count


def test_without_centering_it_is_the_cosine(create):
    queries = images(20)
    database = filled(create, queries[:-1], center=False)
    scaled = Query(0, queries[-1].vectors * 3)
    rows = np.stack([query.unshifted for query in queries[:-1]])
    cosines = (rows @ queries[-1].vectors.T).max(axis=1)
    assert np.allclose(database.search(scaled, 1).similarities, cosines, atol=1e-6)


def test_mean_is_of_all_images_seen_stored_or_not(create):
    queries = images(30)
    database = filled(create, queries[:10])
    for query in queries[10:20]:
        database.update_mean(query)
    means = np.mean([query.vectors for query in queries[:20]], axis=0, dtype=np.float64)
    row = queries[3].unshifted - means[SHIFTS // 2]
    asked = queries[25].vectors - means
    cosines = asked @ row / np.linalg.norm(row) / np.linalg.norm(asked, axis=1)
    found = database.search(queries[25], 1)
    assert found.similarities[3] == pytest.approx(cosines.max(), abs=1e-5)


def test_searching_is_pure(create):
    queries = images(20)
    database = filled(create, queries[:-1])
    first, again = (database.search(queries[-1], 4) for _ in range(2))
    assert first.matches == again.matches and first.by_words == again.by_words
    assert first.background == again.background and first.find(3) == again.find(3)


def test_matches_are_of_different_places_best_first(create):
    queries = images(40)
    found = filled(create, queries[:-1]).search(queries[-1], 5)
    assert len(found.matches) == 5
    similarities = [match.similarity for match in found.matches]
    assert similarities == sorted(similarities, reverse=True)
    assert np.float32(similarities[0]) == found.similarities.max()
    distinct = [match.distinctness for match in found.matches]
    assert distinct == sorted(distinct, reverse=True)
    assert np.diff(sorted(ids(found.matches))).min() > 3


def test_of_equal_matches_the_older_comes_first(create):
    query = images(1)[0]
    queries = images(20, seed=1)
    queries[4] = queries[13] = query
    assert ids(filled(create, queries, center=False).search(query, 2).matches) == [4, 13]


def test_a_match_is_alone_within_three_keyframes_of_its_traverse(create):
    queries = images(30)
    for near in (14, 15, 16, 18, 19):
        queries[near] = Query(0, normalize(queries[15].vectors + 0.01 * queries[near].vectors))
    found = filled(create, queries, center=False).search(queries[15], 2)
    assert ids(found.matches) == [15, 19]
    apart = filled(create, queries, 0, 1, center=False).search(queries[15], 4)
    assert {14, 15} <= set(ids(apart.matches))


def test_only_keyframes_of_a_time_or_before(create):
    queries = images(20)
    database = filled(create, queries)
    assert len(database.search(queries[0], 1, before_ns=45).similarities) == 5
    assert len(database.search(queries[0], 1, before_ns=50).similarities) == 6
    assert ids(database.search(queries[19], 1, before_ns=189).matches) != [19]
    assert database.search(queries[0], 1, before_ns=-1).matches == ()


def test_the_newest_keyframes_can_be_left_out(create):
    queries = images(20)
    database = filled(create, queries)
    assert len(database.search(queries[0], 1, skip_newest=3).similarities) == 17
    assert len(database.search(queries[0], 1, before_ns=45, skip_newest=18).similarities) == 2
    assert database.search(queries[0], 1, skip_newest=30).matches == ()
    # What was not searched is not found either.
    found = database.search(queries[16], 1, skip_newest=3)
    assert found.find(16) is not None and found.find(17) is None


def test_a_keyframe_can_be_left_out(create):
    queries = images(20)
    found = filled(create, queries).search(queries[7], 20, without=7)
    assert 7 not in ids(found.matches) and found.find(7) is None
    assert len(found.similarities) == 20
    # It is no rival either.
    apart = filled(create, queries, center=False).search(queries[15], 1, without=15)
    assert 15 not in {apart.find(index).rival_id for index in range(4)}
    assert ids(filled(create, queries).search(queries[7], 1, without=99).matches) == [7]


def test_background_is_median_and_absolute_deviation(create):
    queries = images(30)
    found = filled(create, queries[:-1]).search(queries[-1], 1)
    median = np.median(found.similarities)
    assert found.background.count == 29
    assert found.background.median == pytest.approx(median)
    deviation = np.median(np.abs(found.similarities - median))
    assert found.background.deviation == pytest.approx(deviation)


def test_keyframes_come_back_as_they_were(create):
    (query,) = images(1)
    keypoints = CompactKeypoints(
        np.ones((2, 2), np.uint16), *(np.ones(2, np.uint8),) * 2, np.ones((2, 4), np.uint8), 0.75
    )
    stamp_ns = 1_776_863_762_100_071_637
    database = create()
    cells = Cells(np.ones((6, 2), np.uint8), np.ones(1, np.uint8), 2, 3, 8)
    database.add(Keyframe(stamp_ns, 5, query.unshifted, keypoints, cells=cells, traverse=2))
    found = database.get(0)
    assert (found.stamp_ns, found.clock_ns, found.traverse) == (stamp_ns, 5, 2)
    assert found.keypoints is keypoints and found.cells is cells
    assert np.array_equal(found.vector, query.unshifted)
    for unknown in (-1, 1, 99):
        with pytest.raises(KeyError):
            database.get(unknown)


def test_nothing_to_compare_is_zero_and_not_nan(create):
    database, zero = create(), Query(0, np.zeros((SHIFTS, DIMENSIONS), np.float32))
    (query,) = images(1)
    database.update_mean(query)
    database.add(keyframe(query))
    # The only keyframe is the mean: no direction is left.
    assert database.search(query, 1).similarities.tolist() == [0]
    database.add(keyframe(zero))
    assert np.isfinite(database.search(zero, 2).similarities).all()


def test_any_keyframe_that_was_searched_can_be_found(create):
    queries = images(30)
    found = filled(create, queries).search(queries[12], 1)
    for keyframe_id, similarity in enumerate(found.similarities):
        match = found.find(keyframe_id)
        assert match.keyframe_id == keyframe_id
        assert match.similarity == pytest.approx(similarity, abs=1e-6)
    assert found.find(12) == found.matches[0]
    assert found.find(30) is None and found.find(-1) is None


def test_without_words_distinctness_is_that_of_the_vector(create):
    queries = images(30)
    found = filled(create, queries[:-1]).search(queries[-1], 1)
    background = found.background
    scale = 1.4826 * background.deviation + 0.02
    for index in range(29):
        match = found.find(index)
        expected = max(match.similarity - background.median, 0) / scale
        assert match.distinctness == pytest.approx(expected, abs=1e-4)
    assert found.by_words == ()


def test_a_query_or_a_database_without_words_is_compared_by_vectors(create):
    queries = images(20)
    worded = with_words(queries, share=1.0)
    for stored, query in ((queries, worded[-1]), (worded, queries[-1])):
        plain = filled(create, queries[:-1]).search(queries[-1], 3)
        found = filled(create, stored[:-1]).search(query, 3)
        assert found.matches == plain.matches and found.by_words == ()
        assert np.array_equal(found.similarities, plain.similarities)


def test_words_find_what_vectors_do_not(create):
    queries = with_words(images(40), share=1.0)
    asked = replace(images(1, seed=9)[0], words=queries[23].words)
    found = filled(create, queries).search(asked, 3)
    assert ids(found.matches)[0] == ids(found.by_words)[0] == 23
    assert found.similarities.argmax() == 23
    assert found.similarities[23] == pytest.approx(found.matches[0].distinctness / 8, abs=1e-6)


def test_keyframes_without_words_have_none_in_common(create):
    queries = with_words(images(40), share=0.5)
    asked = replace(images(1, seed=9)[0], words=np.arange(60, dtype=np.int32))
    found = filled(create, queries).search(asked, 40)
    worded = [query.words is not None for query in queries]
    # All have some of these words, or no words at all.
    best = ids(found.by_words)[:3]
    assert all(worded[index] for index in best)


def rising(count: int) -> list[Query]:
    """Return queries whose similarity to the first axis falls with their distance to 20."""
    vectors = np.zeros((count, 1, DIMENSIONS), np.float32)
    vectors[:, 0, 0], vectors[:, 0, 1] = 1, 1 + np.abs(np.arange(count) - 20)
    return [Query(10 * index, vector) for index, vector in enumerate(normalize(vectors))]


AXIS = Query(0, np.eye(1, DIMENSIONS, dtype=np.float32))


def test_the_rival_is_the_most_distinct_keyframe_of_another_place(create):
    found = filled(create, rising(60), center=False).search(AXIS, 1)
    # From more than ten keyframes away.
    assert found.matches[0].keyframe_id == 20 and found.matches[0].rival_id == 9
    assert found.find(9).rival_id == 20 and found.find(12).rival_id == 23
    for index in (20, 9, 12):
        match = found.find(index)
        assert match.rival_distinctness == found.find(match.rival_id).distinctness
    few = filled(create, rising(11), center=False).search(AXIS, 1)
    assert few.matches[0].rival_id is None and few.matches[0].rival_distinctness == 0


def test_a_rival_may_be_of_another_traverse(create):
    found = filled(create, rising(60), 0, 1, center=False).search(AXIS, 1)
    assert found.find(20).rival_id == 19


def test_a_view_that_was_never_left_is_the_same_visit(create):
    queries = images(30)
    for index in range(20, 30):
        queries[index] = replace(queries[index], vectors=queries[20].vectors)
    database = filled(create, queries, center=False)
    asked = queries[20]
    found = database.search(asked, 30)
    assert [index for index in range(30) if found.find(index).same_visit][-10:] == [*range(20, 30)]
    assert not database.search(replace(asked, traverse=1), 1).matches[0].same_visit
    # Once it is left, it is another visit.
    database.add(keyframe(replace(queries[3], stamp_ns=500)))
    assert not database.search(asked, 1).matches[0].same_visit


def test_the_same_visit_is_left_at_half_of_the_distinctness(create):
    queries = rising(40)
    found = filled(create, queries, center=False).search(AXIS, 1)
    last = found.find(39).distinctness
    for index in range(20, 40):
        match = found.find(index)
        assert match.same_visit is (last >= 0.5 * match.distinctness)


def test_the_oldest_are_two_of_each_traverse(create):
    queries = images(40)
    for traverses, oldest in (((0,), [0, 1]), ((0, 1), [0, 1, 2, 3])):
        found = filled(create, queries, *traverses).search(queries[0], 1)
        assert [index for index in range(40) if found.find(index).oldest] == oldest
    database = filled(create, queries)
    for skip_newest, oldest in ((32, [0, 1]), (33, [])):
        found = database.search(queries[0], 1, skip_newest=skip_newest)
        assert [index for index in range(40 - skip_newest) if found.find(index).oldest] == oldest


def test_what_is_near_and_distances_are_those_of_the_traverse(create):
    database = filled(create, images(9), 0, 0, 1)  # 0 1 | 2 | 3 4 | 5 | 6 7 | 8
    assert database.near(3, 1) == (1, 4) and database.near(5, 1) == (2, 8)
    assert database.near(3, 2) == (0, 1, 4, 6) and database.near(3, 0) == ()
    assert database.near(0, 1) == (1,) and database.near(99, 1) == database.near(-1, 1) == ()
    assert database.distance(0, 7) == database.distance(7, 0) == 5
    assert database.distance(2, 8) == 2 and database.distance(4, 4) == 0
    assert database.distance(4, 5) is None and database.distance(4, 99) is None


def test_other_visits_are_other_traverses_and_long_ago(create):
    database = filled(create, images(9), 0, 0, 1)
    assert database.other_visits(0, -1).tolist() == [2, 5, 8]
    assert database.other_visits(1, -1).tolist() == [0, 1, 3, 4, 6, 7]
    assert database.other_visits(0, 30).tolist() == [0, 1, 2, 3, 5, 8]
    assert database.other_visits(2, -1).tolist() == list(range(9))
    alone = filled(create, images(5))
    assert alone.other_visits(0, -1).tolist() == []
    assert alone.other_visits(0, 20).tolist() == [0, 1, 2]
    assert alone.other_visits(1, -1).tolist() == [*range(5)]
    assert create().other_visits(0, 100).dtype == np.int64


@pytest.mark.parametrize('traverses', [(0,), (0, 1, 1)])
@pytest.mark.parametrize('share', [0.0, 0.7])
@pytest.mark.parametrize('limits', [{}, {'without': 4}, {'before_ns': 250, 'skip_newest': 6}])
def test_both_answer_the_same(traverses, share, limits):
    queries, asked = with_words(images(36), share), with_words(images(36, seed=7), 1.0)
    databases = [filled(create, queries, *traverses) for create in (in_memory, in_a_list)]
    for query in (
        queries[4],
        asked[5],
        replace(asked[30], traverse=1),
        replace(asked[2], words=None),
    ):
        found, wanted = (database.search(query, 6, **limits) for database in databases)
        assert ids(found.matches) == ids(wanted.matches)
        assert ids(found.by_words) == ids(wanted.by_words)
        assert np.allclose(found.similarities, wanted.similarities, atol=1e-4)
        for index in range(len(queries)):
            match, expected = found.find(index), wanted.find(index)
            assert (match is None) == (expected is None)
            if expected is not None:
                assert match == about(expected)


def about(match: Match) -> Match:
    """Return a match that equals those with nearly its numbers."""
    return replace(
        match,
        similarity=pytest.approx(match.similarity, abs=1e-5),
        distinctness=pytest.approx(match.distinctness, abs=1e-3),
        rival_distinctness=pytest.approx(match.rival_distinctness, abs=1e-3),
    )
