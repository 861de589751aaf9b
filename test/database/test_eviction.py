# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What a full database forgets."""

import tracemalloc

from conftest import CellExtractor, texture
from hdc_place_recognition.database.eviction import Forgotten, Limit
from hdc_place_recognition.database.memory import Database
from hdc_place_recognition.database.vector_store import Rows
from hdc_place_recognition.features.compact import keep, Landmarks
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.hdc.algebra import normalize
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
from hdc_place_recognition.verification.temporal import Consistency
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


def fill(limit: int, queries: list[NDArray[np.float32]]) -> Database:
    database = Database(Rows(64), 1, False, 'test', limit=Limit(limit))
    for index, query in enumerate(queries):
        database.ask(query)
        database.add(index, index, query)
    return database


def test_the_image_most_like_its_neighbours_goes():
    # 1 is like 2, and 2 like 3 a little: of 1 and 2 the latter is less missed.
    views = [place(0), place(1), place(1, 2, also=0.5), place(2, 3), place(9)]
    database = fill(4, views)
    assert list(database.ids) == list(database.stamps_ns) == [0, 1, 3, 4]
    assert database.last_forgotten == (Forgotten(row=2, keyframe_id=2),)
    assert database.forgotten == 1 and len(database) == 4


def test_the_only_view_of_a_place_stays():
    first = [place(index) for index in range(5)]
    again = [place(index, 20, also=0.2) for index in (4, 3, 2, 3, 4)]
    database = fill(5, first + again)
    assert len(database) == 5 and database.forgotten == 5
    best = [database.ask(query).similarities.argmax() for query in first]
    assert sorted(best) == [0, 1, 2, 3, 4]
    assert min(database.ask(query).similarities.max() for query in first) > 0.9


def test_of_many_views_the_first_stays_when_a_new_place_comes():
    database = fill(3, [place(0), place(1), place(0, 20, also=0.2), place(5)])
    assert list(database.ids) == [0, 1, 3]


def test_full_of_single_views_nothing_new_is_stored():
    database = fill(3, [place(index) for index in range(3)])
    assert database.add(3, 3, place(7)) is None
    assert database.last_forgotten == (Forgotten(row=3, keyframe_id=3),)
    assert list(database.ids) == [0, 1, 2]


def test_numbers_lead_to_rows():
    database = fill(3, [place(0), place(1), place(0, 20, also=0.2), place(5)])
    assert [database.row(number) for number in range(5)] == [0, 1, None, 2, None]


def test_places_are_used_again_and_answers_follow():
    rng = np.random.default_rng(0)
    drift = normalize(np.cumsum(rng.standard_normal((400, 1, 64), np.float32), axis=0))
    database = fill(20, list(drift))
    assert len(database) == 20 and len(database._rows) == 20
    assert database.nbytes == 20 * (4 * 64 + 8 + 8 + 4 * 8 + 3 * 8 + 8)
    found = database.ask(drift[-1])
    stored = drift[database.ids, 0]
    assert np.allclose(found.similarities, stored @ drift[-1, 0], atol=1e-6)
    assert list(database.ids) == sorted(database.ids) and database.older_than(399, 0) == 20


def test_limit_of_memory_is_kept_with_landmarks_of_any_size():
    rng = np.random.default_rng(0)
    drift = normalize(np.cumsum(rng.standard_normal((400, 1, 64), np.float32), axis=0))
    database = Database(Rows(64), 1, False, 'test', limit=Limit(megabytes=0.1))
    forgotten = []
    for index, query in enumerate(drift):
        database.ask(query)
        database.add(index, index, query, landmarks(1 + index % 40))
        forgotten.append(len(database.last_forgotten))
        assert database.nbytes <= 100_000
    assert max(forgotten) > 1 and sum(forgotten) == database.forgotten == 400 - len(database)
    assert database.nbytes > 90_000 and len(database._rows) == len(database) == len(database.ids)
    stored = drift[list(database.ids), 0]
    found = database.ask(drift[-1]).similarities
    assert np.allclose(found, stored @ drift[-1, 0], atol=1e-6)


def test_memory_is_what_is_promised():
    rng = np.random.default_rng(0)
    queries = normalize(rng.standard_normal((1500, 1, 1024), np.float32))
    database = Database(Rows(1024), 1, True, 'test')
    tracemalloc.start()
    for index, query in enumerate(queries):
        # Numbers as large as real ones are objects.
        database.add(index + 10**18, index + 10**18, query, landmarks(20))
    taken, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # Less the rows of the last chunk that are still empty, which no page is taken for.
    empty = 36 * 4 * 1024 + (2048 - 1500) * 128
    assert database.nbytes == pytest.approx(taken - empty, rel=0.05)


def landmarks(count: int) -> Landmarks:
    return keep(
        LocalFeatures(
            keypoints=np.zeros((count, 2), np.float32),
            descriptors=np.zeros((count, 128), np.float32),
            width=320,
            height=240,
            sizes=np.ones(count, np.float32),
            angles=np.zeros(count, np.float32),
        )
    )


def test_support_follows_the_rows():
    consistency = Consistency()
    consistency.remember(20, 3.0)
    assert consistency.support(24, True) and not consistency.support(15, True)
    consistency.forget(3)
    assert consistency.support(15, True) and not consistency.support(24, True)


def test_recognizer_is_bounded_and_names_images_by_their_numbers():
    params = Params(
        dimensions=1024, exclude_recent_s=2.0, max_keyframes=8, keyframe_similarity=1.0
    )
    one = PlaceRecognizer(params, CellExtractor())
    places = [0, 0, 0, *range(10, 16), 12, 13, 14]
    found = [one.process(index * S, texture(each)) for index, each in enumerate(places)]
    assert len(one.database) == 8
    assert [each.forgotten_ids for each in found[:8]] == [()] * 8
    assert found[8].forgotten_ids in ((0,), (1,), (2,))
    assert [each.candidates[0].match_id for each in found[9:]] == [5, 6, 7]
    assert [each.candidates[0].match_stamp_ns // S for each in found[9:]] == [5, 6, 7]
    blank = one.process(60 * S, np.zeros((48, 64), np.uint8))
    assert blank.forgotten_ids == ()
