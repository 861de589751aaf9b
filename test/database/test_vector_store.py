# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The store of hypervectors: half floats, files, and removed vectors."""

import errno
import os

from conftest import CellExtractor, texture
from hdc_place_recognition.database.base import Keyframe, Query
from hdc_place_recognition.database.eviction import Capacity
from hdc_place_recognition.database.memory import MemoryDatabase
from hdc_place_recognition.database.sign_index import signs
from hdc_place_recognition.database.storage import FileStorage, RamStorage
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


@pytest.mark.parametrize('slots', [(0,), (255, 255), (256, 0), (512, 511), (512, 256, 255, 0)])
def test_the_last_vector_takes_the_place_of_a_removed_one(slots):
    queries = vectors(513)
    store, content = VectorStore(128), list(range(513))
    for query in queries:
        store.add(query, ZERO)
    for slot in slots:
        store.remove(slot)
        content[slot] = content[-1]
        content.pop()
    held = queries[content]
    assert len(store) == len(content)
    assert np.array_equal(store.gather(np.arange(len(content)))[0], held)
    assert np.array_equal([store.vector(slot) for slot in range(len(content))], held)
    assert store.squares(len(content)) == pytest.approx(np.ones(len(content)))
    for count in (len(content), 257, 256, 255, 1):
        products = store.products(queries[:1], count)
        assert np.allclose(products, held[:count] @ queries[:1].T, atol=1e-6)
    found = [store.signs.get(slot) for slot in range(len(content))]
    assert np.array_equal(found, signs(held, ZERO))


def test_squared_lengths_move_with_their_vectors():
    store = VectorStore(128)
    for length in (1, 2, 3):
        store.add(length * vectors(1)[0], ZERO)
    store.remove(0)
    assert store.squares(2) == pytest.approx([9, 4])
    assert store.gather(np.array([1, 0]))[1] == pytest.approx([4, 9])


@pytest.mark.parametrize('count', [1, 2, 3, 4])
def test_products_with_few_and_many_probes(count):
    queries = vectors(40)
    store = VectorStore(128)
    for query in queries:
        store.add(query, ZERO)
    products = store.products(queries[:count], 40)
    assert products.shape == (40, count)
    assert np.allclose(products, queries @ queries[:count].T, atol=1e-6)


class Counting(RamStorage):
    """Storage that counts its matrices."""

    def __init__(self) -> None:
        self.matrices = 0

    def allocate(self, rows: int, dimensions: int, dtype: np.dtype) -> NDArray:
        self.matrices += 1
        return super().allocate(rows, dimensions, dtype)

    def release(self, matrix: NDArray) -> None:
        self.matrices -= 1


def test_one_empty_chunk_is_kept():
    storage, held = Counting(), {}
    store = VectorStore(128, storage=storage)
    for count in range(1, 514):
        store.add(ZERO, ZERO)
        held[count] = storage.matrices
    assert [held[count] for count in (1, 256, 257, 512, 513)] == [1, 1, 2, 2, 3]
    for count in reversed(range(513)):
        store.remove(0)
        held[count] = storage.matrices
    assert [held[count] for count in (512, 256, 255, 0)] == [3, 3, 2, 2]


def test_signs_are_taken_again_of_slots_that_follow():
    store = VectorStore(128)
    for query in vectors(258):
        store.add(query, ZERO)
    high = np.full(128, 9, np.float32)
    store.update_signs(254, high, 2)
    store.update_signs(257, high, 2)
    cleared = [slot for slot in range(258) if not store.signs.get(slot).any()]
    assert cleared == [254, 255, 257]


def test_bytes_of_a_slot(tmp_path):
    # Vector, signs and squared length; 100 signs take two words.
    assert VectorStore(100).slot_nbytes == 400 + 16 + 8
    assert VectorStore(100, 'float16').slot_nbytes == 200 + 16 + 8
    assert VectorStore(100, storage=FileStorage(tmp_path)).slot_nbytes == 16 + 8


def test_matrices_lie_on_pages_and_in_one_map(tmp_path, monkeypatch):
    monkeypatch.setattr('hdc_place_recognition.database.storage._MAP_BYTES', 4 * 4096)
    storage, byte = FileStorage(tmp_path), np.dtype(np.uint8)
    sizes, ends, maps = (4096, 4097, 4096, 2 * 4096, 1), [], []
    matrices = []
    for number, size in enumerate(sizes):
        matrices.append(storage.allocate(1, size, byte))
        matrices[-1][:] = number
        ends.append(storage._end // 4096)
        maps.append(len(storage._maps))
    # 1 page, 2 pages, 1 page: the map is full. 2 pages and 1 page in the next one.
    assert ends == [1, 3, 4, 6, 7] and maps == [1, 1, 1, 2, 2]
    storage.drop_pages()
    for number, (matrix, size) in enumerate(zip(matrices, sizes, strict=True)):
        assert matrix.shape == (1, size) and (matrix == number).all()
    # Two pages no longer fit behind these.
    assert storage.allocate(2, 4096, byte).shape == (2, 4096)
    assert storage._end == 10 * 4096 and len(storage._maps) == 3
    storage.release(matrices[0])
    assert storage.allocate(1, 4096, byte) is matrices[0]


def test_the_last_row_is_removed_without_an_order():
    order = SlotOrder()
    for _ in range(3):
        order.append()
    order.remove(2)
    assert order.row_nbytes == 0 and order.slots_to_read(1) == 1
    order.append()
    order.remove(0)
    # The vector of the last row is now in slot 0.
    assert [order.slot(row) for row in range(2)] == [1, 0]
    assert order.row_nbytes == 8 and order.slots_to_read(1) == 2
    assert order.in_order(np.array([[7, 8, 9]]), 2).tolist() == [[8, 7]]
    order.append()
    assert order.slots(np.array([2, 0])).tolist() == [2, 1]
