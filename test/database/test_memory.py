# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What is particular to the database in memory: growth, means in any order, bytes."""

from hdc_place_recognition.database import memory, search
from hdc_place_recognition.database.base import Keyframe, Query
from hdc_place_recognition.database.eviction import Capacity
from hdc_place_recognition.database.memory import MemoryDatabase
from hdc_place_recognition.database.vector_store import VectorStore
from hdc_place_recognition.features.compact import CompactKeypoints
from hdc_place_recognition.hdc.algebra import normalize
import numpy as np
from numpy.typing import NDArray
import pytest


def images(count: int, shifts: int = 3, dimensions: int = 64) -> NDArray[np.float32]:
    """Return (count, shifts, dimensions) queries with a common part for centering to subtract."""
    rng = np.random.default_rng(0)
    common = rng.standard_normal((shifts, dimensions))
    own = rng.standard_normal((count, shifts, dimensions))
    return normalize((own + common).astype(np.float32))


def add(database: MemoryDatabase, number: int, vectors: NDArray[np.float32]) -> int | None:
    keyframe = Keyframe(number, number, vectors[len(vectors) // 2])
    return database.add(keyframe).keyframe_id


def filled(vectors: NDArray[np.float32]) -> MemoryDatabase:
    database = MemoryDatabase(VectorStore(vectors.shape[2]), vectors.shape[1], True)
    for number, image in enumerate(vectors):
        database.update_mean(Query(number, image))
        assert add(database, number, image) == number
    return database


@pytest.mark.parametrize('count', [1024, 1025, 2500])
def test_centered_cosine_over_many_chunks(count):
    vectors = images(count + 1)
    database = filled(vectors[:-1])
    database.update_mean(Query(0, vectors[-1]))
    found = database.search(Query(0, vectors[-1]), 1, exact=True).similarities
    means = vectors.astype(np.float64).mean(axis=0)
    asked, rows = vectors[-1] - means, vectors[:-1, 1] - means[1]
    table = rows @ asked.T / np.linalg.norm(rows, axis=1)[:, None]
    cosines = (table / np.linalg.norm(asked, axis=1)).max(axis=1)
    assert found.dtype == np.float32 and found.shape == (count,)
    assert np.allclose(found, cosines, atol=1e-6)


@pytest.mark.parametrize('shifts', [1, 3])
def test_any_order_of_calls(shifts):
    rng = np.random.default_rng(1)
    vectors = images(400, shifts)
    database = MemoryDatabase(VectorStore(64), shifts, True, capacity=Capacity(100))
    seen: list[int] = []
    for number, image in enumerate(vectors):
        query, action = Query(number, image), rng.integers(4)
        if action:
            database.update_mean(query)
            seen.append(number)
        if action > 1 and len(database):
            left_out = int(rng.integers(0, len(database))) if action == 2 else 0
            found = database.search(query, 1, skip_newest=left_out, exact=True).similarities
            means = vectors[seen].astype(np.float64).mean(axis=0)
            ids = database.ids[: len(database) - left_out]
            rows = vectors[list(ids), shifts // 2] - means[shifts // 2]
            asked = image - means
            table = rows @ asked.T / np.linalg.norm(rows, axis=1)[:, None]
            cosines = (table / np.linalg.norm(asked, axis=1)).max(axis=1)
            assert np.allclose(found, cosines, atol=1e-6)
        # An id is that of the images that were added, which are all of them.
        add(database, number, image)
    assert len(database) == 100 and database.evicted_count == 300


def test_growth_moves_no_vector():
    vectors = images(257)
    database = filled(vectors[:256])
    first, held = database.get(0).vector, database.nbytes
    add(database, 256, vectors[256])
    assert np.shares_memory(database.get(0).vector, first)
    assert database.nbytes == held * 257 / 256


def test_two_traverses_do_not_disturb_each_other():
    vectors = images(24)
    mixed = MemoryDatabase(VectorStore(64), 3, False, capacity=Capacity(16))
    for number, image in enumerate(vectors):
        keyframe = Keyframe(number, number, image[1], traverse=number % 2)
        mixed.add(keyframe)
    for keyframe_id in mixed.ids:
        near = mixed.near(keyframe_id, 1)
        assert near and all(found % 2 == keyframe_id % 2 for found in near)
        assert all(mixed.distance(keyframe_id, found) == 1 for found in near)


def test_signs_are_taken_again_two_at_a_time():
    # The first images are -1, so that their mean falls from 0 on; sign 1 is above the mean.
    database = MemoryDatabase(VectorStore(64), 1, True)
    written = []
    update = database._store.update_signs

    def note(slot: int, threshold: NDArray[np.float32], count: int = 1) -> None:
        written.append((slot, count, float(threshold[0])))
        update(slot, threshold, count)

    database._store.update_signs = note
    for number in range(6):
        vectors = np.full((1, 64), number, np.float32)
        database.update_mean(Query(number, vectors))
        add(database, number, vectors)
    # The new row, then two older ones, each against the mean of all images so far.
    assert [call[0] for call in written] == [0, 0, 1, 0, 2, 2, 3, 0, 4, 2, 5, 4]
    assert [call[1] for call in written] == [1, 2] * 6
    assert [call[2] for call in written] == [0, 0, 0.5, 0.5, 1, 1, 1.5, 1.5, 2, 2, 2.5, 2.5]


def test_two_stages_begin_at_a_number_of_keyframes(monkeypatch):
    called = []
    for name in ('search_all', 'search_in_two_stages'):
        function = getattr(memory, name)
        monkeypatch.setattr(
            memory, name, lambda *given, to=function: (called.append(to.__name__), to(*given))[1]
        )
    monkeypatch.setattr(memory, 'TWO_STAGES_FROM', 8)
    vectors = images(9)
    database = filled(vectors)
    for skip_newest, exact in ((2, False), (1, False), (0, False), (0, True)):
        database.search(Query(0, vectors[0]), 1, skip_newest=skip_newest, exact=exact)
    two = 'search_in_two_stages'
    assert called == ['search_all', two, two, 'search_all']


def test_a_place_is_three_keyframes_before_and_after():
    database = MemoryDatabase(VectorStore(64), 1, False)
    for number in range(32):
        # Least alike to the query at both ends of the first twelve, and unlike the others.
        vectors = np.zeros((1, 64), np.float32)
        vectors[0, :2] = number < 12, 1 + abs(number - 5)
        add(database, number, vectors)
    query = Query(0, np.eye(1, 64, dtype=np.float32))
    found = database.search(query, 3).matches
    assert [match.keyframe_id for match in found] == [5, 1, 9]
    found = database.search(query, 3, without=5).matches
    assert [match.keyframe_id for match in found] == [4, 8, 0]
    assert len(database.search(query, 2).matches) == 2
    assert database.search(query, 0).matches == ()


def test_bytes_are_counted_with_keypoints_and_evictions():
    kept = CompactKeypoints(
        np.ones((2, 2), np.uint16), *(np.ones(2, np.uint8),) * 2, np.ones((2, 4), np.uint8), 1.0
    )
    database = MemoryDatabase(VectorStore(64), 1, False, capacity=Capacity(9))
    row = 4 * 64 + 8 + 8 + 60 + 3 * 8
    vector = np.ones(64, np.float32)
    assert database.nbytes == 0
    for number, keypoints in enumerate((kept, None, kept)):
        database.add(Keyframe(number, number, vector, keypoints))
    assert database.nbytes == 3 * row + 2 * kept.nbytes
    database._evict(2)
    assert database.nbytes == 2 * row + kept.nbytes
    database._evict(1)
    assert database.nbytes == row + kept.nbytes


def test_a_twin_is_the_row_of_its_id():
    database = MemoryDatabase(VectorStore(64), 1, False, capacity=Capacity(4))
    eye = np.eye(5, 64, dtype=np.float32)
    for number in range(4):
        database.add(Keyframe(number, number, eye[number]))
    # Like 1 and unlike its neighbor 3: evicted as the twin of the former.
    view = normalize(eye[1] + 0.5 * eye[4])
    assert database.add(Keyframe(4, 4, view, twin=1)).evicted == (4,)
    assert database.add(Keyframe(5, 5, view, twin=None)).evicted == (5,)
    assert database.ids == (0, 1, 2, 3)


def test_words_are_kept_in_the_index_and_go_with_their_keyframe():
    database = MemoryDatabase(VectorStore(64), 1, False, capacity=Capacity(3))
    eye, plain = np.eye(5, 64, dtype=np.float32), MemoryDatabase(VectorStore(64), 1, False)
    for number in range(3):
        words = np.arange(10 * number, 10 * number + 10, dtype=np.int32)
        database.add(Keyframe(number, number, eye[number], words=words))
        plain.add(Keyframe(number, number, eye[number]))
    assert database.get(1).words is None and database.nbytes > plain.nbytes
    query = Query(0, eye[4][None], words=np.arange(10, 20, dtype=np.int32))
    assert database.search(query, 1).matches[0].keyframe_id == 1
    database._evict(1)
    found = database.search(query, 2)
    assert not found.similarities.any() and {match.keyframe_id for match in found.by_words} <= {
        0,
        2,
    }
    assert len(database._words) == 2


def test_two_stages_compare_what_words_put_first(monkeypatch):
    for name, value in {'_NEAREST': 1, '_SPACED': 1, '_BEST': 0}.items():
        monkeypatch.setattr(search, name, value)
    monkeypatch.setattr(memory, 'TWO_STAGES_FROM', 8)
    monkeypatch.setattr(memory, '_COMPARED_BY_WORDS', 1)
    vectors = images(60, shifts=1)
    database = MemoryDatabase(VectorStore(64), 1, False)
    for number, image in enumerate(vectors):
        words = np.arange(10 * number, 10 * number + 15, dtype=np.int32)
        database.add(Keyframe(number, number, image[0], words=words))
    query = Query(0, vectors[7], words=np.arange(400, 415, dtype=np.int32))
    found, exact = (database.search(query, 1, exact=exact) for exact in (False, True))
    assert found.by_words[0].keyframe_id == 40
    for keyframe_id in (7, 40):
        similarity = exact.find(keyframe_id).similarity
        assert found.find(keyframe_id).similarity == pytest.approx(similarity, abs=1e-6)


def test_matches_follow_what_is_evicted():
    rng, capacity = np.random.default_rng(3), 30
    database = MemoryDatabase(VectorStore(64), 1, False, capacity=Capacity(capacity))
    drift = normalize(np.cumsum(rng.standard_normal((200, 1, 64), np.float32), axis=0))
    worded = {}
    for number, image in enumerate(drift):
        words = np.unique(rng.integers(0, 300, 20)).astype(np.int32)
        query = Query(number, image, words=words, traverse=number % 2)
        result = database.search(query, 3)
        twin = result.matches[0].keyframe_id if result.matches else None
        added = Keyframe(number, number, image[0], words=words, traverse=number % 2, twin=twin)
        worded[number] = words
        for evicted in database.add(added).evicted:
            assert database.search(query, 3).find(evicted) is None
    assert len(database) == len(database._words) == capacity
    for keyframe_id in database.ids:
        query = Query(0, drift[keyframe_id], words=worded[keyframe_id])
        result = database.search(query, 2)
        best = result.matches[0]
        assert best.keyframe_id == result.by_words[0].keyframe_id == keyframe_id
        assert best.similarity == pytest.approx(1, abs=1e-5)
        apart = database.distance(keyframe_id, best.rival_id)
        assert apart is None or apart > 10
