# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Two stages against the exact search, and the signs that they go by."""

from hdc_place_recognition.database import memory, search, sign_index
from hdc_place_recognition.database.base import Background, Keyframe, Query, SearchResult
from hdc_place_recognition.database.memory import MemoryDatabase
from hdc_place_recognition.database.sign_index import SignIndex
from hdc_place_recognition.database.vector_store import VectorStore
from hdc_place_recognition.hdc.algebra import normalize
from hdc_place_recognition.hdc.shifts import Shifts
import numpy as np
from numpy.typing import NDArray
import pytest

Queries = NDArray[np.float32]
DIMENSIONS = 1024


def places(count: int) -> Queries:
    """Return (count, 9, d) images with a common part, and shifts that resemble their neighbors."""
    rng = np.random.default_rng(0)
    own = rng.standard_normal((count, 4, 4, DIMENSIONS), np.float32)
    forms = own[:, :3, :3] + own[:, 1:, :3] + own[:, :3, 1:] + own[:, 1:, 1:]
    common = rng.standard_normal((9, DIMENSIONS), np.float32)
    return normalize(forms.reshape(count, 9, -1) / 2 + common)


def shifted(queries: Queries, noise: float = 0.5) -> Queries:
    """Return the images again: shifted by as much as there are shifts for, and noisy."""
    rng = np.random.default_rng(1)
    turned = np.roll(queries, 1, axis=1)
    return normalize(turned + noise * rng.standard_normal(turned.shape, np.float32) / 32)


def fill(queries: Queries) -> MemoryDatabase:
    database = MemoryDatabase(VectorStore(DIMENSIONS), 9, True)
    for number, query in enumerate(queries):
        database.update_mean(Query(number, query))
        database.add(Keyframe(number, number, query[4]))
    return database


def search_row(database: MemoryDatabase, query: Queries, **options: object) -> Queries:
    return database.search(Query(0, query), 10, **options).similarities


def best(database: MemoryDatabase, query: Queries, **options: object) -> SearchResult:
    return database.search(Query(0, query), 1, **options).matches[0]


@pytest.fixture
def filled(monkeypatch: pytest.MonkeyPatch) -> tuple[MemoryDatabase, Queries]:
    """Return a database of 1500 places that searches in two stages from 700 on."""
    monkeypatch.setattr(memory, 'TWO_STAGES_FROM', 700)
    monkeypatch.setattr(search, '_NEAREST', 100)
    queries = places(1500)
    return fill(queries), queries


def test_finds_the_same_as_the_exact_search(filled):
    database, queries = filled
    for query in shifted(queries[::50]):
        fast, exact = best(database, query), best(database, query, exact=True)
        assert fast.keyframe_id == exact.keyframe_id and fast.shift == exact.shift
        assert fast.similarity == pytest.approx(exact.similarity, abs=1e-6)


def test_rows_not_compared_are_estimates_below_the_others(filled):
    database, queries = filled
    (query,) = shifted(queries[700:701])
    fast, exact = search_row(database, query), search_row(database, query, exact=True)
    same = np.isclose(fast, exact, atol=1e-6)
    assert 100 <= same.sum() <= 100 + 128 + 32
    assert np.isfinite(fast).all() and np.median(np.abs(fast - exact)) < 0.1
    highest = np.sort(np.flatnonzero(same)[np.argsort(-fast[same])][:20])
    assert set(highest) <= set(np.argsort(-fast)[:20])
    assert same[[699, 701]].all()


def test_background_is_distributed_as_all_rows(filled):
    database, queries = filled
    (query,) = shifted(queries[3:4])
    fast, exact = (
        database.search(Query(0, query), 1, exact=exact).background for exact in (False, True)
    )
    assert fast.count == 128 and exact.count == 1500
    assert fast.median == pytest.approx(exact.median, abs=0.01)
    assert fast.deviation == pytest.approx(exact.deviation, rel=0.3)


def test_prefix_is_searched_alone_and_small_ones_exactly(filled):
    database, queries = filled
    (query,) = shifted(queries[1400:1401])
    assert best(database, query).keyframe_id == 1400
    before = search_row(database, query, skip_newest=100)
    assert before.shape == (1400,) and before.max() < 0.5
    small = [search_row(database, query, before_ns=698, exact=exact) for exact in (True, False)]
    assert np.array_equal(*small)


def test_a_new_row_is_found_at_once(filled):
    database, _ = filled
    (query,) = places(1501)[-1:]
    assert best(database, query).similarity < 0.5
    added = database.add(Keyframe(2000, 2000, query[4])).keyframe_id
    assert best(database, query).keyframe_id == added == 1500


def test_part_of_the_signs_chooses_those_that_are_compared_further(filled, monkeypatch):
    database, queries = filled
    monkeypatch.setattr(sign_index, '_COARSE_WORDS', 4)
    coarse = fill(queries)
    whole = [best(database, query) for query in shifted(queries[::50])]
    monkeypatch.setattr(search, '_ALL_SIGNS', 1000)
    monkeypatch.setattr(search, '_LEAST', 300)
    for query, expected in zip(shifted(queries[::50]), whole, strict=True):
        found = best(coarse, query)
        assert found.keyframe_id == expected.keyframe_id
        assert found.similarity == pytest.approx(expected.similarity, abs=1e-6)
        exact = search_row(database, query, exact=True)
        assert np.median(np.abs(search_row(coarse, query) - exact)) < 0.1


def test_answers_are_the_same_every_time(filled):
    database, queries = filled
    (query,) = shifted(queries[7:8])
    assert np.array_equal(search_row(database, query), search_row(database, query))


def test_signs_are_above_the_threshold():
    vectors = np.array([[1, -1, 3, 0], [0, 0, 0, 5]], np.float32)
    threshold = np.array([0, -2, 4, 0], np.float32)
    bits = np.unpackbits(sign_index.signs(vectors, threshold).view(np.uint8), axis=1)
    assert bits.shape == (2, 64) and not bits[:, 4:].any()
    assert bits[:, :4].tolist() == [[1, 1, 0, 0], [0, 1, 0, 1]]


@pytest.mark.parametrize('dimensions', [64, 100, 1024, 1500])
def test_distances_to_queries(dimensions, monkeypatch):
    vectors = np.random.default_rng(0).standard_normal((2060, dimensions), np.float32)
    rows = sign_index.signs(vectors, np.float32(0))
    table = SignIndex(sign_index.word_count(dimensions))
    for place, row in enumerate(rows):
        table.put(place, row[None])
    places = np.array([3, 700, 2047, 2048, 2059])
    differing = (vectors[:, None] > 0) != (vectors[None, :3] > 0)
    expected = differing[places].sum(axis=2)
    for count in (sign_index.bit_count, sign_index.count_in_words):
        monkeypatch.setattr(sign_index, 'bit_count', count)
        first = table.coarse(rows[:3], len(rows))
        assert np.array_equal(first.T, differing[:, :, :1024].sum(axis=2))
        rest = table.fine(rows[:3], places)
        assert np.array_equal((first[:, places] + rest).T, expected)
    assert table.fine(rows[:3], places[:0]).shape == (3, 0)


@pytest.mark.parametrize('count', [2047, 2048, 2049])
def test_a_block_of_signs_ends_where_the_slots_do(count):
    table = SignIndex(17)
    # Slot n differs from 0 in 1 of the coarse signs, or in 2 if n is even; in 3 of the others.
    rows = np.zeros((2, 17), np.uint64)
    rows[:, 0], rows[:, 16] = (3, 1), 7
    for slot in range(count):
        table.put(slot, rows[slot % 2, None])
    zero = np.zeros((1, 17), np.uint64)
    last = np.array([0, count - 1])
    assert table.coarse(zero, count)[0, last].tolist() == [2, 1 + count % 2]
    assert table.coarse(zero, count - 1).shape == (1, count - 1)
    assert table.fine(zero, last).tolist() == [[3, 3]]
    assert np.array_equal(table.get(count - 1), rows[(count - 1) % 2])
    table.truncate(2047)
    assert len(table._blocks) == 1
    table.truncate(0)
    table.put(0, zero)
    assert table.coarse(zero, 1).tolist() == [[0]] and len(table._blocks) == 1


def test_one_empty_block_of_signs_is_kept():
    table = SignIndex(1)
    for slot in range(4097):
        table.put(slot, np.zeros((1, 1), np.uint64))
    blocks = []
    for slots in (4096, 4095, 2048, 2047):
        table.truncate(slots)
        blocks.append(len(table._blocks))
    assert blocks == [3, 2, 2, 1]


def test_ones_are_counted_without_numpy_2():
    bits = np.array([0, 1, 2**64 - 1, 0x8000000000000001, 0x5555555555555555], np.uint64)
    assert sign_index.count_in_words(bits).tolist() == [0, 1, 64, 2, 32]


def test_cosine_of_a_distance():
    found = sign_index.cosines(np.array([0, 512, 1024], np.uint32), 1024)
    assert np.allclose(found, [1, 0, -1], atol=1e-6)


def test_nearest_of_equals_are_the_first():
    distances = np.array([5, 3, 5, 5, 3, 9], np.uint32)
    assert sign_index.nearest(distances, 3).tolist() == [0, 1, 4]
    assert sign_index.nearest(distances, 9).tolist() == [0, 1, 2, 3, 4, 5]


def test_groups_of_shifts_overlap():
    assert Shifts(1, 1, 0.1).groups == ((0,),)
    assert Shifts(3, 1, 0.1).groups == ((0, 1, 2),)
    groups = Shifts(5, 5, 0.1).groups
    assert groups[0] == (0, 1, 2, 5, 6, 7, 10, 11, 12) and len(groups) == 4
    assert set(sum(groups, ())) == set(range(25))


def test_a_query_is_known_by_its_middle_vector():
    vectors = np.arange(10, dtype=np.float32).reshape(5, 2)
    assert Query(0, vectors).unshifted.tolist() == [4, 5] and not Query(0, vectors).empty
    assert Query(0, vectors[:1]).unshifted.tolist() == [0, 1]
    assert Query(0, np.zeros((3, 2), np.float32)).empty


def test_background_of_nothing_is_zero():
    assert Background.of(np.empty(0, np.float32)) == Background(0, 0.0, 0.0)
    assert Background.of(np.array([1, 2, 6], np.float32)) == Background(3, 2.0, 1.0)
