# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The database against formulas written out."""

from hdc_place_recognition.database.eviction import Limit
from hdc_place_recognition.database.memory import Database
from hdc_place_recognition.database.vector_store import Rows
from hdc_place_recognition.hdc.algebra import normalize
import numpy as np
from numpy.typing import NDArray
import pytest

Queries = NDArray[np.float32]


def images(count: int, forms: int = 3, dimensions: int = 64) -> Queries:
    """Return (count, forms, dimensions) queries with a common part, for centring to take away."""
    rng = np.random.default_rng(0)
    common = rng.standard_normal((forms, dimensions))
    own = rng.standard_normal((count, forms, dimensions))
    return normalize((own + common).astype(np.float32))


def filled(queries: Queries, *, center: bool = True) -> Database:
    database = Database(Rows(queries.shape[2]), queries.shape[1], center, 'test')
    for index, query in enumerate(queries):
        database.see(query)
        assert database.add(index * 10, index * 10, query) == index
    return database


def cosines(query: Queries, rows: Queries, seen: Queries) -> tuple[Queries, NDArray[np.intp]]:
    """Return similarities and displacements as the docstring has them, in float64."""
    means = seen.astype(np.float64).mean(axis=0)
    a, b = query - means, rows[:, 1] - means[1]
    table = b @ a.T / np.linalg.norm(b, axis=1)[:, None] / np.linalg.norm(a, axis=1)
    return table.max(axis=1), table.argmax(axis=1)


@pytest.mark.parametrize('count', [2, 50, 1024, 1025, 2500])
def test_centred_cosine_under_the_best_displacement(count):
    queries = images(count + 1)
    database = filled(queries[:-1])
    database.see(queries[-1])
    found = database.ask(queries[-1], exact=True)
    similarities, displacements = cosines(queries[-1], queries[:-1], queries)
    assert found.similarities.dtype == np.float32 and found.similarities.shape == (count,)
    assert np.allclose(found.similarities, similarities, atol=1e-6)
    assert np.array_equal(found.displacements, displacements)
    assert set(found.displacements) == ({0, 1, 2} if count > 2 else set(displacements))


def test_without_centring_it_is_the_cosine():
    queries = images(20)
    found = filled(queries[:-1], center=False).ask(queries[-1] * 3)
    assert np.allclose(
        found.similarities, (queries[:-1, 1] @ queries[-1].T).max(axis=1), atol=1e-6
    )


def test_mean_is_of_all_images_seen_stored_or_not():
    queries = images(30)
    database = filled(queries[:10])
    for query in queries[10:20]:
        database.see(query)
    found = database.ask(queries[-1]).similarities
    assert len(found) == 10
    assert np.allclose(found, cosines(queries[-1], queries[:10], queries[:20])[0], atol=1e-6)


def test_rows_added_late_know_the_mean_too():
    queries = images(30)
    database = filled(queries[:10])
    for query in queries[10:20]:
        database.see(query)
    database.add(0, 0, queries[20])
    found = database.ask(queries[-1]).similarities
    rows = queries[[*range(10), 20]]
    assert np.allclose(found, cosines(queries[-1], rows, queries[:20])[0], atol=1e-6)


def test_asking_changes_nothing():
    queries = images(6)
    asked = Database(Rows(64), 3, True, 'test')
    for index, query in enumerate(queries[:5]):
        asked.ask(query)
        asked.see(query)
        asked.ask(query)
        asked.add(index, index, query)
    found, expected = asked.ask(queries[5]), filled(queries[:5]).ask(queries[5])
    assert np.array_equal(found.similarities, expected.similarities)


def test_one_form_in_any_order_of_calls():
    rng = np.random.default_rng(1)
    queries = images(400, forms=1)
    database = Database(Rows(64), 1, True, 'test', limit=Limit(100))
    seen: list[int] = []
    for index, query in enumerate(queries):
        action = rng.integers(4)
        if action:
            database.see(query)
            seen.append(index)
        if action > 1 and len(database):
            count = int(rng.integers(1, len(database) + 1)) if action == 2 else len(database)
            found = database.ask(query, count, exact=True).similarities
            means = queries[seen].astype(np.float64).mean(axis=0)
            rows = queries[list(database.ids)[:count], 0] - means
            expected = rows @ (query - means)[0] / np.linalg.norm(query - means)
            expected /= np.linalg.norm(rows, axis=1)
            assert np.allclose(found, expected, atol=1e-6)
        # Numbers are those of images that were added: all of them.
        database.add(index, index, query)
    assert len(database) == 100 and database.forgotten == 300


def test_a_query_just_seen_needs_one_pass_over_the_rows(monkeypatch):
    queries = images(60, forms=1)
    database = filled(queries[:50])
    database.ask(queries[50], exact=True)
    passes = []
    products = Rows.products

    def counted(self, probes, count, first=0):
        passes.append((len(probes), count - first))
        return products(self, probes, count, first)

    monkeypatch.setattr(Rows, 'products', counted)
    database.see(queries[51])
    database.ask(queries[51], exact=True)
    assert sum(probes * rows for probes, rows in passes) == 50


def test_first_rows_only():
    queries = images(9)
    database = filled(queries[:-1])
    whole = database.ask(queries[-1]).similarities
    assert np.array_equal(database.ask(queries[-1], 3).similarities, whole[:3])
    assert database.ask(queries[-1], 0).similarities.shape == (0,)


def test_nothing_to_compare_is_zero_not_nan():
    database = Database(Rows(4), 1, True, 'test')
    query = np.array([[1, 0, 0, 0]], np.float32)
    assert database.ask(query).similarities.shape == (0,)
    database.see(query)
    database.add(0, 0, query)
    # The only row is the mean: nothing of it is left.
    assert database.ask(query).similarities.tolist() == [0]
    zero = np.zeros((1, 4), np.float32)
    database.add(1, 1, zero)
    assert np.isfinite(database.ask(zero).similarities).all()


def test_older_than_by_time_and_by_count():
    database = filled(images(10))  # clock 0, 10, ..., 90
    assert database.older_than(45, 0) == 5
    assert database.older_than(50, 0) == 6
    assert database.older_than(1000, 3) == 7
    assert database.older_than(45, 8) == 2
    assert database.older_than(-1, 0) == 0
    assert database.older_than(1000, 20) == 0


def test_growth_moves_no_row():
    queries = images(257)
    database = filled(queries[:256])
    first, held = database._rows.vector(0), database.nbytes
    database.add(0, 0, queries[256])
    assert np.shares_memory(database._rows.vector(0), first)
    assert database.nbytes == held * 257 / 256


def test_stamps_are_exact():
    database = Database(Rows(2), 1, True, 'test')
    database.add(1_776_863_762_100_071_637, 0, np.array([[1, 0]], np.float32))
    assert list(database.stamps_ns) == [1_776_863_762_100_071_637]
