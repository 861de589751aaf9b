# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The store of hypervectors: half floats, files, and removed vectors."""

import errno
import os

from conftest import CellExtractor, texture
from hdc_place_recognition.database.base import Keyframe, Query
from hdc_place_recognition.database.eviction import Capacity
from hdc_place_recognition.database.memory import MemoryDatabase
from hdc_place_recognition.database.storage import FileStorage
from hdc_place_recognition.database.vector_store import SlotOrder, VectorStore
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.hdc.algebra import normalize
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import assemble
from hdc_place_recognition.results import Frame
import numpy as np
from numpy.typing import NDArray
import pytest

ZERO = np.zeros(128, np.float32)


def vectors(count: int) -> NDArray[np.float32]:
    rng = np.random.default_rng(0)
    return normalize(rng.standard_normal((count, 128), np.float32))


def filled(
    store: VectorStore, queries: NDArray[np.float32], capacity: Capacity | None = None
) -> MemoryDatabase:
    database = MemoryDatabase(store, 1, True, capacity=capacity)
    for number, query in enumerate(queries):
        database.update_mean(Query(number, query[None]))
        database.add(Keyframe(number, number, query))
    return database


def search(
    database: MemoryDatabase, query: NDArray[np.float32], exact: bool
) -> NDArray[np.float32]:
    return database.search(Query(0, query[None]), 1, exact=exact).similarities


@pytest.mark.parametrize('exact', [True, False])
def test_half_floats_answer_the_same_within_their_precision(exact):
    queries = vectors(3000)
    whole = filled(VectorStore(128), queries)
    half = filled(VectorStore(128, 'float16'), queries)
    assert half.nbytes == whole.nbytes - 3000 * 2 * 128
    for query in queries[:5]:
        expected, found = (search(database, query, exact) for database in (whole, half))
        assert found.dtype == np.float32 and found.argmax() == expected.argmax()
        best = np.argsort(-expected)[:200]
        assert np.allclose(found[best], expected[best], atol=2**-11)


@pytest.mark.parametrize('kind', ['float32', 'float16'])
def test_rows_in_a_file_answer_the_same_and_leave_nothing(tmp_path, kind):
    queries = vectors(2500)
    expected = filled(VectorStore(128, kind), queries)
    found = filled(VectorStore(128, kind, FileStorage(tmp_path)), queries)
    assert expected.nbytes - found.nbytes == 2500 * 128 * np.dtype(kind).itemsize
    assert list(tmp_path.iterdir()) == []
    for exact in (True, False):
        answers = [search(database, queries[7], exact) for database in (expected, found)]
        assert np.array_equal(*answers)


def test_what_is_taken_out_of_a_file_is_used_again(tmp_path):
    storage = FileStorage(tmp_path)
    database = filled(VectorStore(128, 'float32', storage), vectors(2000), Capacity(300))
    assert len(database) == 300 and database.evicted_count == 1700
    assert storage._end <= 3 * 256 * 128 * 4
    stored = vectors(2000)[list(database.ids)]
    rows = [database._vector(row) for row in range(300)]
    assert np.array_equal(rows, stored)


def test_many_maps(tmp_path, monkeypatch):
    monkeypatch.setattr('hdc_place_recognition.database.storage._MAP_BYTES', 64 * 4096)
    storage = FileStorage(tmp_path)
    queries = vectors(1500)
    store = VectorStore(128, 'float32', storage)
    for query in queries:
        store.add(query, ZERO)
    assert len(storage._maps) == 3
    assert np.array_equal(store.gather(np.arange(1500))[0], queries)


def test_a_full_disk_is_reported_and_the_robot_goes_on(tmp_path, monkeypatch):
    params = Params(dimensions=64, exclude_recent_s=0.0, keyframe_similarity=1.0)
    params = params.replace(rows_folder=str(tmp_path))
    recognizer = assemble(params, CellExtractor())

    def full(*_: int) -> None:
        raise OSError(errno.ENOSPC, 'No space left on device')

    monkeypatch.setattr(os, 'posix_fallocate', full)
    refused = recognizer.process(Frame(0, texture(0)))
    assert refused.keyframe_id is None and len(recognizer.database) == 0
    assert refused.not_stored.startswith(f'rows_folder {tmp_path}: No space left on device for ')
    assert 'set max_keyframes' in refused.not_stored
    monkeypatch.undo()
    stored = recognizer.process(Frame(10**9, texture(0)))
    assert stored.keyframe_id == 0 and not stored.not_stored
    assert recognizer.process(Frame(2 * 10**9, texture(0))).candidates[0].match_id == 0


def test_no_such_folder_is_one_line(tmp_path):
    with pytest.raises(PlaceRecognitionError, match=r'rows_folder .*none: No such file.*name a'):
        assemble(Params(rows_folder=str(tmp_path / 'none')), CellExtractor())


def test_order_of_what_moves():
    order, content = SlotOrder(), []
    for number in range(6):
        order.append()
        content.append(number)
    expected = list(range(6))
    assert order.slots_to_read(3) == 3 and order.row_nbytes == 0
    for row in (5, 1, 0, 2):
        place = order.slot(row)
        content[place] = content[-1]
        content.pop()
        order.remove(row)
        del expected[row]
        held = np.array(content)
        assert order.in_order(held, len(expected)).tolist() == expected
        assert held[order.slots(np.arange(len(expected)))].tolist() == expected
    assert expected == [2, 3] and order.slots_to_read(1) == 2
