# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which keyframes a full database evicts."""

import tracemalloc

from conftest import CellExtractor, texture
from hdc_place_recognition.database.base import Added, Keyframe, Query
from hdc_place_recognition.database.eviction import Capacity
from hdc_place_recognition.database.memory import MemoryDatabase
from hdc_place_recognition.database.vector_store import VectorStore
from hdc_place_recognition.features.compact import CompactKeypoints, quantize
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.hdc.algebra import normalize
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import assemble
from hdc_place_recognition.results import Frame
import numpy as np
from numpy.typing import NDArray
import pytest

S = 1_000_000_000


def place(*parts: int, also: float = 1.0) -> NDArray[np.float32]:
    """Return a query of one form: a unit vector of some parts, the others as strong as `also`."""
    vector = np.zeros((1, 64), np.float32)
    vector[0, list(parts)] = also
    vector[0, parts[0]] = 1
    return normalize(vector)


def search(database: MemoryDatabase, vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    return database.search(Query(0, vectors), 1).similarities


def add(
    database: MemoryDatabase,
    number: int,
    vectors: NDArray[np.float32],
    kept: CompactKeypoints | None = None,
) -> Added:
    """Add an image as a robot does: with the most similar keyframe as its twin."""
    matches = database.search(Query(number, vectors), 1).matches
    twin = matches[0].keyframe_id if matches else None
    return database.add(Keyframe(number, number, vectors[0], kept, twin=twin))


def fill(
    capacity: Capacity | int, queries: list[NDArray[np.float32]]
) -> tuple[MemoryDatabase, list[Added]]:
    limit = Capacity(capacity) if isinstance(capacity, int) else capacity
    database = MemoryDatabase(VectorStore(64), 1, False, capacity=limit)
    return database, [add(database, *numbered) for numbered in enumerate(queries)]


def test_the_keyframe_most_similar_to_its_neighbors_is_evicted():
    # 1 is like 2, and 2 like 3 a little: of 1 and 2 the latter is less missed.
    views = [place(0), place(1), place(1, 2, also=0.5), place(2, 3), place(9)]
    database, added = fill(4, views)
    assert database.ids == (0, 1, 3, 4)
    assert [database.get(found).stamp_ns for found in database.ids] == [0, 1, 3, 4]
    assert added[-1] == Added(4, (2,)) and added[:-1] == [Added(number) for number in range(4)]
    assert database.evicted_count == 1 and len(database) == 4


def test_an_end_of_the_row_is_no_more_redundant_than_the_middle():
    # 0 and 1 are equally similar to each other; 1 is also similar to 2.
    views = [place(0), place(0, 1, also=0.5), place(1, 2, also=0.9), place(9)]
    assert fill(3, views)[0].ids == (0, 2, 3)


def test_the_only_view_of_a_place_stays():
    first = [place(index) for index in range(5)]
    again = [place(index, 20, also=0.2) for index in (4, 3, 2, 3, 4)]
    database, _ = fill(5, first + again)
    assert len(database) == 5 and database.evicted_count == 5
    best = [search(database, query).argmax() for query in first]
    assert sorted(best) == [0, 1, 2, 3, 4]
    assert min(search(database, query).max() for query in first) > 0.9


def test_of_many_views_the_first_stays_when_a_new_place_comes():
    database, _ = fill(3, [place(0), place(1), place(0, 20, also=0.2), place(5)])
    assert database.ids == (0, 1, 3)


def test_a_full_database_of_single_views_takes_nothing_new():
    database, _ = fill(3, [place(index) for index in range(3)])
    assert add(database, 3, place(7)) == Added(None, (3,))
    assert database.ids == (0, 1, 2)


def test_views_are_alike_from_a_cosine_of_03():
    for also, evicted in ((0.33, 1), (0.3, 3)):
        # Cosine also / sqrt(1 + also^2): .313 and .287.
        views = [place(0), place(1), place(2, 1, also=also), place(3)]
        assert fill(3, views)[1][-1].evicted == (evicted,)


def test_evicted_keyframes_are_unknown():
    database, _ = fill(3, [place(0), place(1), place(0, 20, also=0.2), place(5)])
    assert database.near(2, 1) == () and database.distance(1, 2) is None
    assert database.near(3, 1) == (1,) and database.distance(0, 3) == 2
    with pytest.raises(KeyError):
        database.get(2)


def test_an_evicted_twin_is_no_longer_one():
    # 2 is the twin of 0; once 0 is evicted, 2 is the only view of its place and stays.
    views = [place(0), place(1), place(0, 20, also=0.2)]
    database, _ = fill(Capacity(3), views)
    database._evict(0)
    for number in (5, 6, 7):
        add(database, number, place(number))
    assert 2 in database.ids


def test_slots_are_used_again_and_answers_follow():
    rng = np.random.default_rng(0)
    drift = normalize(np.cumsum(rng.standard_normal((400, 1, 64), np.float32), axis=0))
    database, _ = fill(20, list(drift))
    assert len(database) == 20 and len(database._store) == 20
    assert database.nbytes == 20 * (4 * 64 + 8 + 8 + 60 + 3 * 8 + 8)
    stored = drift[list(database.ids), 0]
    assert np.allclose(search(database, drift[-1]), stored @ drift[-1, 0], atol=1e-6)
    assert list(database.ids) == sorted(database.ids)
    assert len(database.search(Query(0, drift[-1]), 1, before_ns=399).similarities) == 20


def test_limit_of_memory_is_kept_with_keypoints_of_any_size():
    rng = np.random.default_rng(0)
    drift = normalize(np.cumsum(rng.standard_normal((400, 1, 64), np.float32), axis=0))
    database = MemoryDatabase(VectorStore(64), 1, False, capacity=Capacity(megabytes=0.1))
    evicted = []
    for number, vectors in enumerate(drift):
        evicted.append(len(add(database, number, vectors, keypoints(1 + number % 40)).evicted))
        assert database.nbytes <= 100_000
    assert max(evicted) > 1 and sum(evicted) == database.evicted_count == 400 - len(database)
    assert database.nbytes > 90_000 and len(database._store) == len(database) == len(database.ids)
    stored = drift[list(database.ids), 0]
    assert np.allclose(search(database, drift[-1]), stored @ drift[-1, 0], atol=1e-6)


def test_memory_is_what_is_promised():
    rng = np.random.default_rng(0)
    vectors = normalize(rng.standard_normal((1500, 1, 1024), np.float32))
    database = MemoryDatabase(VectorStore(1024), 1, True)
    tracemalloc.start()
    for number, vector in enumerate(vectors):
        # Numbers as large as real stamps are objects.
        database.add(Keyframe(number + 10**18, number + 10**18, vector[0], keypoints(20)))
    taken, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # Less the rows of the last chunk that are still empty, which no page is taken for.
    empty = 36 * 4 * 1024 + (2048 - 1500) * 128
    assert database.nbytes == pytest.approx(taken - empty, rel=0.05)


def keypoints(count: int) -> CompactKeypoints:
    return quantize(
        LocalFeatures(
            keypoints=np.zeros((count, 2), np.float32),
            descriptors=np.zeros((count, 128), np.float32),
            width=320,
            height=240,
            sizes=np.ones(count, np.float32),
            angles=np.zeros(count, np.float32),
        )
    )


def test_recognizer_is_bounded_and_names_images_by_their_numbers():
    params = Params(
        dimensions=1024, exclude_recent_s=2.0, max_keyframes=8, keyframe_similarity=1.0
    )
    recognizer = assemble(params, CellExtractor())
    visits = [0, 0, 0, *range(10, 16), 12, 13, 14]
    found = [
        recognizer.process(Frame(index * S, texture(detection)))
        for index, detection in enumerate(visits)
    ]
    assert len(recognizer.database) == 8
    assert [detection.evicted_ids for detection in found[:8]] == [()] * 8
    assert found[8].evicted_ids in ((0,), (1,), (2,))
    assert [detection.candidates[0].match_id for detection in found[9:]] == [5, 6, 7]
    assert [detection.candidates[0].match_stamp_ns // S for detection in found[9:]] == [5, 6, 7]
    blank = recognizer.process(Frame(60 * S, np.zeros((48, 64), np.uint8)))
    assert blank.evicted_ids == ()
