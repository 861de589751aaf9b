# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What is particular to the database in memory: growth, means in any order, bytes."""

from hdc_place_recognition.database.base import Keyframe, Query
from hdc_place_recognition.database.eviction import Capacity
from hdc_place_recognition.database.memory import MemoryDatabase
from hdc_place_recognition.database.vector_store import VectorStore
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
        near = mixed.neighbors(keyframe_id)
        assert near and all(found % 2 == keyframe_id % 2 for found in near)
        assert all(mixed.distance(keyframe_id, found) == 1 for found in near)
