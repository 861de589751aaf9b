# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Two stages against the exact search, and the signs that they go by."""

from hdc_place_recognition.database import memory, search, sign_index
from hdc_place_recognition.database.memory import Database
from hdc_place_recognition.database.sign_index import SignTable
from hdc_place_recognition.database.vector_store import Rows
from hdc_place_recognition.hdc.algebra import normalize
from hdc_place_recognition.hdc.shifts import Shifts
import numpy as np
from numpy.typing import NDArray
import pytest

Queries = NDArray[np.float32]
DIMENSIONS = 1024


def places(count: int) -> Queries:
    """Return (count, 9, d) images with a common part and forms that resemble their neighbours."""
    rng = np.random.default_rng(0)
    own = rng.standard_normal((count, 4, 4, DIMENSIONS), np.float32)
    forms = own[:, :3, :3] + own[:, 1:, :3] + own[:, :3, 1:] + own[:, 1:, 1:]
    common = rng.standard_normal((9, DIMENSIONS), np.float32)
    return normalize(forms.reshape(count, 9, -1) / 2 + common)


def displaced(queries: Queries, noise: float = 0.5) -> Queries:
    """Return the images again: displaced by as much as there are forms for, and noisy."""
    rng = np.random.default_rng(1)
    turned = np.roll(queries, 1, axis=1)
    return normalize(turned + noise * rng.standard_normal(turned.shape, np.float32) / 32)


@pytest.fixture
def filled(monkeypatch: pytest.MonkeyPatch) -> tuple[Database, Queries]:
    """Return a database of 1500 places that searches in two stages from 700 on."""
    monkeypatch.setattr(memory, 'TWO_STAGES_FROM', 700)
    monkeypatch.setattr(search, '_NEAREST', 100)
    one, queries = Database(Rows(DIMENSIONS), 9, True, 'test'), places(1500)
    for index, query in enumerate(queries):
        one.see(query)
        one.add(index, index, query)
    return one, queries


def test_finds_the_same_as_the_exact_search(filled):
    one, queries = filled
    for query in displaced(queries[::50]):
        fast, exact = one.ask(query), one.ask(query, exact=True)
        best = exact.similarities.argmax()
        assert fast.similarities.argmax() == best
        assert fast.similarities[best] == pytest.approx(exact.similarities[best], abs=1e-6)
        assert fast.displacements[best] == exact.displacements[best]


def test_rows_not_compared_are_estimates_below_the_others(filled):
    one, queries = filled
    (query,) = displaced(queries[700:701])
    fast, exact = one.ask(query).similarities, one.ask(query, exact=True).similarities
    same = np.isclose(fast, exact, atol=1e-6)
    assert 100 <= same.sum() <= 100 + 128 + 32
    assert np.isfinite(fast).all() and np.median(np.abs(fast - exact)) < 0.1
    best = np.sort(np.flatnonzero(same)[np.argsort(-fast[same])][:20])
    assert set(best) <= set(np.argsort(-fast)[:20])
    assert same[[699, 701]].all()


def test_background_is_distributed_as_all_rows(filled):
    one, queries = filled
    (query,) = displaced(queries[3:4])
    fast, exact = one.ask(query).background, one.ask(query, exact=True).background
    assert len(fast) == 128 and len(exact) == 1500
    assert np.median(fast) == pytest.approx(np.median(exact), abs=0.01)
    assert fast.std() == pytest.approx(exact.std(), rel=0.3)


def test_prefix_is_searched_alone_and_small_ones_exactly(filled):
    one, queries = filled
    (query,) = displaced(queries[1400:1401])
    assert one.ask(query).similarities.argmax() == 1400
    before = one.ask(query, 1400).similarities
    assert before.shape == (1400,) and before.max() < 0.5
    assert np.array_equal(
        one.ask(query, 699).similarities, one.ask(query, 699, exact=True).similarities
    )


def test_a_new_row_is_found_at_once(filled):
    one, _ = filled
    (query,) = places(1501)[-1:]
    assert one.ask(query).similarities.max() < 0.5
    row = one.add(0, 0, query)
    assert one.ask(query).similarities.argmax() == row == 1500


def test_part_of_the_signs_chooses_those_that_are_looked_at_further(filled, monkeypatch):
    one, queries = filled
    monkeypatch.setattr(sign_index, '_COARSE_WORDS', 4)
    coarse = Database(Rows(DIMENSIONS), 9, True, 'test')
    for index, query in enumerate(queries):
        coarse.see(query)
        coarse.add(index, index, query)
    whole = [one.ask(query) for query in displaced(queries[::50])]
    monkeypatch.setattr(search, '_ALL_SIGNS', 1000)
    monkeypatch.setattr(search, '_LEAST', 300)
    for query, expected in zip(displaced(queries[::50]), whole, strict=True):
        found = coarse.ask(query)
        best = expected.similarities.argmax()
        assert found.similarities.argmax() == best
        assert found.similarities[best] == pytest.approx(expected.similarities[best], abs=1e-6)
        exact = one.ask(query, exact=True).similarities
        assert np.median(np.abs(found.similarities - exact)) < 0.1


def test_answers_are_the_same_every_time(filled):
    one, queries = filled
    (query,) = displaced(queries[7:8])
    first, again = one.ask(query), one.ask(query)
    assert np.array_equal(first.similarities, again.similarities)


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
    table = SignTable(sign_index.words(dimensions))
    for place, row in enumerate(rows):
        table.put(place, row[None])
    places = np.array([3, 700, 2047, 2048, 2059])
    differing = (vectors[:, None] > 0) != (vectors[None, :3] > 0)
    expected = differing[places].sum(axis=2)
    for count in (sign_index.count, sign_index.count_in_words):
        monkeypatch.setattr(sign_index, 'count', count)
        first = table.coarse(rows[:3], len(rows))
        assert np.array_equal(first.T, differing[:, :, :1024].sum(axis=2))
        rest = table.fine(rows[:3], places)
        assert np.array_equal((first[:, places] + rest).T, expected)
    assert table.fine(rows[:3], places[:0]).shape == (3, 0)


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


def test_groups_of_displacements_overlap():
    assert Shifts(1, 1, 0.1).groups == ((0,),)
    assert Shifts(3, 1, 0.1).groups == ((0, 1, 2),)
    groups = Shifts(5, 5, 0.1).groups
    assert groups[0] == (0, 1, 2, 5, 6, 7, 10, 11, 12) and len(groups) == 4
    assert set(sum(groups, ())) == set(range(25))
