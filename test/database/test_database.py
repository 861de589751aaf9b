# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What every keyframe database must answer: the one in memory, and the one of a list."""

from __future__ import annotations

from collections.abc import Callable

from hdc_place_recognition.database.base import (
    Background,
    Keyframe,
    KeyframeDatabase,
    Match,
    Query,
)
from hdc_place_recognition.database.memory import MemoryDatabase
from hdc_place_recognition.database.vector_store import VectorStore
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


def keyframe(query: Query, traverse: int = 0) -> Keyframe:
    return Keyframe(query.stamp_ns, query.stamp_ns, query.unshifted, traverse=traverse)


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
    assert first.matches == again.matches and first.others == again.others
    assert first.background == again.background


def test_matches_are_of_different_places_best_first(create):
    queries = images(40)
    found = filled(create, queries[:-1]).search(queries[-1], 5)
    assert len(found.matches) == 5
    similarities = [match.similarity for match in found.matches]
    assert similarities == sorted(similarities, reverse=True)
    assert np.float32(similarities[0]) == found.similarities.max()
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


def test_others_are_the_neighbors_and_what_was_asked_for(create):
    queries = images(30)
    database = filled(create, queries)
    found = database.search(queries[12], 1, also=[3, 99])
    assert ids(found.matches) == [12] and set(found.others) == {11, 13, 3}
    for keyframe_id, match in found.others.items():
        assert match.keyframe_id == keyframe_id
        assert match.similarity == pytest.approx(found.similarities[keyframe_id], abs=1e-6)
    assert set(database.search(queries[29], 1).others) == {28}
    assert 11 not in database.search(queries[12], 1, without=11, also=[11]).others


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
    # What was not searched is no neighbor either.
    assert set(database.search(queries[16], 1, skip_newest=3).others) == {15}


def test_a_keyframe_can_be_left_out(create):
    queries = images(20)
    found = filled(create, queries).search(queries[7], 20, without=7)
    assert 7 not in ids(found.matches) and 7 not in found.others
    assert len(found.similarities) == 20
    assert ids(filled(create, queries).search(queries[7], 1, without=99).matches) == [7]


def test_the_edge_is_that_of_the_traverse(create):
    queries = images(40)
    alone = filled(create, queries).search(queries[0], 0, also=range(40))
    edge = [match.keyframe_id for match in alone.others.values() if match.at_edge]
    assert sorted(edge) == [0, 1, 38, 39]
    both = filled(create, queries, 0, 1).search(queries[0], 0, also=range(40), skip_newest=2)
    edge = [match.keyframe_id for match in both.others.values() if match.at_edge]
    assert sorted(edge) == [0, 1, 2, 3, 34, 35, 36, 37]
    few = filled(create, queries[:7]).search(queries[0], 0, also=range(7))
    assert not any(match.at_edge for match in few.others.values())


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
        np.ones((2, 2), np.uint16), *(np.ones(2, np.uint8),) * 2, np.ones((2, 8), np.uint8), 0.75
    )
    stamp_ns = 1_776_863_762_100_071_637
    database = create()
    database.add(Keyframe(stamp_ns, 5, query.unshifted, keypoints, traverse=2))
    found = database.get(0)
    assert (found.stamp_ns, found.clock_ns, found.traverse) == (stamp_ns, 5, 2)
    assert found.keypoints is keypoints and np.array_equal(found.vector, query.unshifted)
    for unknown in (-1, 1, 99):
        with pytest.raises(KeyError):
            database.get(unknown)


def test_neighbors_and_distances_are_those_of_the_traverse(create):
    database = filled(create, images(9), 0, 0, 1)  # 0 1 | 2 | 3 4 | 5 | 6 7 | 8
    assert database.neighbors(3) == (1, 4) and database.neighbors(5) == (2, 8)
    assert database.neighbors(0) == (1,) and database.neighbors(99) == ()
    assert database.distance(0, 7) == database.distance(7, 0) == 5
    assert database.distance(2, 8) == 2 and database.distance(4, 4) == 0
    assert database.distance(4, 5) is None and database.distance(4, 99) is None


def test_nothing_to_compare_is_zero_and_not_nan(create):
    database, zero = create(), Query(0, np.zeros((SHIFTS, DIMENSIONS), np.float32))
    (query,) = images(1)
    database.update_mean(query)
    database.add(keyframe(query))
    # The only keyframe is the mean: no direction is left.
    assert database.search(query, 1).similarities.tolist() == [0]
    database.add(keyframe(zero))
    assert np.isfinite(database.search(zero, 2).similarities).all()


def test_both_answer_the_same():
    queries, asked = images(60), images(5, seed=7)
    databases = [filled(create, queries, 0, 1, 1) for create in (in_memory, in_a_list)]
    for query in asked:
        found, wanted = (
            database.search(query, 6, before_ns=500, also=[4]) for database in databases
        )
        assert ids(found.matches) == ids(wanted.matches)
        assert set(found.others) == set(wanted.others)
        for match, wanted_match in zip(found.matches, wanted.matches, strict=True):
            assert match == Match(
                wanted_match.keyframe_id,
                pytest.approx(wanted_match.similarity, abs=1e-5),
                wanted_match.shift,
                wanted_match.at_edge,
            )
