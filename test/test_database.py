# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The database against formulas written out."""

from hdc_place_recognition.core.database import best_rows, Database
from hdc_place_recognition.core.hdc import normalize
import numpy as np
import pytest


def rows(count: int, dimensions: int = 64) -> np.ndarray:
    rng = np.random.default_rng(0)
    # A common part, so that centring has something to take away.
    return normalize((rng.standard_normal((count, dimensions)) + 1).astype(np.float32))


def filled(vectors: np.ndarray, *, center: bool = True) -> Database:
    database = Database(vectors.shape[1], center, 'test')
    for index, vector in enumerate(vectors):
        assert database.add(index * 10, index * 10, vector) == index
    return database


def centred(query: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    mean = vectors.astype(np.float64).mean(axis=0)
    a, b = query - mean, vectors - mean
    return b @ a / np.linalg.norm(a) / np.linalg.norm(b, axis=1)


@pytest.mark.parametrize('count', [2, 50, 1024, 1025, 2500])
def test_centred_cosine_as_written_out(count):
    vectors = rows(count + 1)
    found = filled(vectors[:-1]).similarities(vectors[-1])
    assert found.dtype == np.float32 and found.shape == (count,)
    assert np.allclose(found, centred(vectors[-1], vectors[:-1]), atol=1e-6)


def test_without_centring_it_is_the_cosine():
    vectors = rows(20)
    found = filled(vectors[:-1], center=False).similarities(vectors[-1] * 3)
    assert np.allclose(found, vectors[:-1] @ vectors[-1], atol=1e-6)


def test_mean_is_causal():
    vectors = rows(30)
    database = filled(vectors[:10])
    before = database.similarities(vectors[-1])
    assert np.allclose(before, centred(vectors[-1], vectors[:10]), atol=1e-6)
    for vector in vectors[10:20]:
        database.add(0, 0, vector)
    after = database.similarities(vectors[-1], 10)
    assert np.allclose(after, centred(vectors[-1], vectors[:20])[:10], atol=1e-6)


def test_asking_before_adding_changes_nothing():
    vectors = rows(5)
    asked = Database(64, True, 'test')
    for index, vector in enumerate(vectors):
        asked.similarities(vector)
        asked.add(index, index, vector)
    query = rows(6)[-1]
    assert np.array_equal(asked.similarities(query), filled(vectors).similarities(query))


def test_nothing_to_compare_is_zero_not_nan():
    database = Database(4, True, 'test')
    query = np.array([1, 0, 0, 0], np.float32)
    assert database.similarities(query).shape == (0,)
    database.add(0, 0, query)
    # The only row is the mean: nothing of it is left.
    assert database.similarities(query).tolist() == [0]
    database.add(1, 1, np.zeros(4, np.float32))
    assert np.isfinite(database.similarities(np.zeros(4, np.float32))).all()


def test_older_than_by_time_and_by_count():
    database = filled(rows(10))  # clock 0, 10, ..., 90
    assert database.older_than(45, 0) == 5
    assert database.older_than(50, 0) == 6
    assert database.older_than(1000, 3) == 7
    assert database.older_than(45, 8) == 2
    assert database.older_than(-1, 0) == 0
    assert database.older_than(1000, 20) == 0


def test_growth_moves_no_row():
    vectors = rows(1030)
    database = filled(vectors[:1024])
    first = database._chunks[0].rows
    one_chunk = database.nbytes
    database.add(0, 0, vectors[1024])
    assert database._chunks[0].rows is first
    assert database.nbytes == 2 * one_chunk


def test_stamps_are_exact():
    database = Database(2, True, 'test')
    database.add(1_776_863_762_100_071_637, 0, np.array([1, 0], np.float32))
    assert database.stamps_ns == [1_776_863_762_100_071_637]


def test_best_rows_of_equals_the_older_first():
    similarities = np.array([0.1, 0.5, 0.3, 0.5, 0.5, 0.2], np.float32)
    assert best_rows(similarities, 2).tolist() == [1, 3]
    assert best_rows(similarities, 4).tolist() == [1, 3, 4, 2]
    assert best_rows(similarities, 10).tolist() == [1, 3, 4, 2, 5, 0]
    assert best_rows(similarities[:0], 3).tolist() == []
