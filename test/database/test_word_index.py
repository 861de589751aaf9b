# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Inverted lists, compared with a dictionary of sets; growth, removal and limits."""

from __future__ import annotations

from hdc_place_recognition.database import word_index
from hdc_place_recognition.database.word_index import WordIndex
import numpy as np
from numpy.typing import NDArray
import pytest

Words = NDArray[np.int32]


class SetIndex:
    """The formula as it reads."""

    def __init__(self) -> None:
        self.images: dict[int, set[int]] = {}

    def frequency(self, word: int) -> int:
        return sum(word in image for image in self.images.values())

    def weights(self, words: Words) -> NDArray[np.float64]:
        twice = 2 * len(self.images) + 2
        frequency = np.array([max(self.frequency(word), 1) for word in words.tolist()])
        return np.maximum(np.log(twice / (2 * frequency + 1)) / np.log(twice / 3), 0)

    def add(self, slot: int, words: Words) -> None:
        assert slot not in self.images
        self.images[slot] = {*words.tolist()}

    def remove(self, slot: int) -> None:
        del self.images[slot]

    def similarities(self, words: Words, lengths: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return the similarity of each slot; lengths are those of the time of adding."""
        squares = dict(zip(words.tolist(), self.weights(words) ** 2, strict=True))
        length = np.sqrt(sum(squares.values()))
        found = np.zeros(len(lengths))
        for slot, image in self.images.items():
            common = sum(squares[word] for word in image & squares.keys())
            found[slot] = common * lengths[slot] / max(length, 1e-9)
        return found


def draw(rng: np.random.Generator, words: int, size: int) -> Words:
    """Return words of which some are far more frequent than others."""
    return np.unique((words * rng.random(size) ** 3).astype(np.int32))


def swept(index: WordIndex) -> None:
    """Drop all entries of removed keyframes, as enough new keyframes do."""
    index._drop_removed(np.arange(len(index._start), dtype=np.int32))


def entries(index: WordIndex, word: int) -> list[int]:
    """Return the slots with keyframes in the list of a word."""
    found, _ = index._entries(np.array([word]))
    return [slot for slot in found.tolist() if index._inverse_length[slot]]


def test_a_word_of_one_keyframe_weighs_one_and_of_all_nothing():
    index = WordIndex(600)
    for number in range(20):
        index.add(np.array([0, 10 + number], np.int32))
    weights = index.weights(np.array([0, 10, 500], np.int32))
    assert weights == pytest.approx([np.log(42 / 41) / np.log(14), 1, 1])
    assert WordIndex(600).weights(np.zeros(3, np.int32)).tolist() == [1, 1, 1]


def test_the_similarity_is_the_cosine_of_weighted_words():
    rng, index, sets = np.random.default_rng(0), WordIndex(200), SetIndex()
    images = [draw(rng, 200, 30) for _ in range(60)]
    lengths = []
    for image in images:
        slot = index.add(image)
        sets.add(slot, image)
        lengths.append(1 / np.sqrt((sets.weights(image) ** 2).sum()))
    query = images[17][::2]
    found = index.similarities(query)
    np.testing.assert_allclose(found, sets.similarities(query, np.array(lengths)), rtol=1e-5)
    assert found.argmax() == 17 and found.dtype == np.float32
    # With itself, but for the words that have become more frequent since.
    assert index.similarities(images[59])[59] == pytest.approx(1, abs=1e-5)


def test_nothing_in_common_is_zero():
    index = WordIndex(600)
    assert index.similarities(np.array([1], np.int32)).shape == (0,)
    index.add(np.array([1, 2], np.int32))
    assert index.similarities(np.array([3], np.int32)).tolist() == [0]
    assert index.similarities(np.empty(0, np.int32)).tolist() == [0]
    index.add(np.empty(0, np.int32))
    assert np.isfinite(index.similarities(np.array([1, 2], np.int32))).all()


@pytest.mark.parametrize('seed', range(2))
def test_any_order_of_adding_and_removing(seed):
    rng, index, sets = np.random.default_rng(seed), WordIndex(700), SetIndex()
    target, reused = 40, 0
    for step in range(1500):
        if step % 300 == 0:
            target = int(rng.integers(5, 150))
        if len(sets.images) > rng.integers(0, 2 * target):
            slot = int(rng.choice([*sets.images]))
            index.remove(slot)
            sets.remove(slot)
        else:
            words = draw(rng, 700, int(rng.integers(0, 40)))
            before = index._slots
            slot = index.add(words)
            reused += before == index._slots
            sets.add(slot, words)
        assert len(index) == len(sets.images)
        if step % 30 == 0:
            check(index, sets, draw(rng, 700, 30))
    assert reused > 50
    swept(index)
    words = np.arange(700, dtype=np.int32)
    frequency = [sets.frequency(word) for word in range(700)]
    assert index._frequency.tolist() == frequency == index._count.tolist()
    np.testing.assert_allclose(index.weights(words), sets.weights(words), rtol=1e-6)
    check(index, sets, draw(rng, 700, 30))


def check(index: WordIndex, sets: SetIndex, query: Words) -> None:
    """Compare lists and similarities with those of sets."""
    for word in query.tolist():
        expected = sorted(slot for slot, image in sets.images.items() if word in image)
        assert sorted(entries(index, word)) == expected
    # Frequencies count removed keyframes until they are swept: only the formula is compared.
    squares, found = index.weights(query) ** 2, index.similarities(query)
    assert len(found) == index._slots
    length = max(np.sqrt(squares.sum()), 1e-9)
    for slot in range(index._slots):
        image = sets.images.get(slot, set())
        common = sum(squares[[word in image for word in query.tolist()]])
        expected = common * index._inverse_length[slot] / length
        assert found[slot] == pytest.approx(expected, rel=1e-4, abs=1e-7)


def test_lists_never_share_room():
    rng, index = np.random.default_rng(5), WordIndex(600)
    slots = []
    for step in range(900):
        slots.append(index.add(draw(rng, 600, 30)))
        if step % 3:
            index.remove(slots.pop(int(rng.integers(len(slots)))))
    used = np.flatnonzero(index._capacity > 0)
    blocks = [(index._start[word], index._capacity[word]) for word in used]
    for capacity, free in index._free_blocks.items():
        blocks += [(start, capacity) for start in np.concatenate(free)]
    blocks.sort()
    ends = [start + capacity for start, capacity in blocks]
    assert all(end <= start for end, (start, _) in zip(ends, blocks[1:], strict=False))
    assert ends[-1] <= index._used


def test_a_list_that_grows_too_long_is_given_up(monkeypatch):
    monkeypatch.setattr(word_index, '_LONGEST', 20)
    index, common = WordIndex(600), np.array([7], np.int32)
    for number in range(60):
        index.add(np.array([7, 100 + number], np.int32))
        if number == 20:
            # The capacities are 4, 6, 9, 13, 19 and 28.
            assert np.count_nonzero(index.similarities(common)) == 21
    assert not entries(index, 7) and not index.similarities(common).any()
    found = index.similarities(np.array([7, 130], np.int32))
    assert found.argmax() == 30 and found[30] > 0.999
    # Its room is used by another list of the same capacity.
    used = index._used
    index._allocate(1, 28)
    assert index._used == used


def test_a_list_given_up_stays_so_when_keyframes_go(monkeypatch):
    monkeypatch.setattr(word_index, '_LONGEST', 4)
    index = WordIndex(600)
    slots = [index.add(np.array([7, 100 + number], np.int32)) for number in range(10)]
    for slot in slots[:9]:
        index.remove(slot)
    for number in range(30):
        index.add(np.array([7, 200 + number], np.int32))
    assert not index.similarities(np.array([7], np.int32)).any()


def test_a_query_reads_its_rarest_words_up_to_a_limit():
    index = WordIndex(600, entries_read=50)
    for number in range(100):
        index.add(np.array([0, 1] if number == 60 else [0], np.int32))
    found = index.similarities(np.array([0, 1], np.int32))
    assert found.argmax() == 60 and np.count_nonzero(found) == 1


def test_the_slots_grow_beyond_the_first():
    index = WordIndex(600)
    slots = [index.add(np.array([number % 600], np.int32)) for number in range(2100)]
    assert slots == list(range(2100))
    found = index.similarities(np.array([5], np.int32))
    assert np.flatnonzero(found).tolist() == [5, 605, 1205, 1805]


def test_a_slot_is_used_again_only_after_a_whole_sweep():
    index = WordIndex(1024)
    old = [index.add(np.array([1, 2], np.int32)) for _ in range(3)]
    for slot in old:
        index.remove(slot)
    # The first sweep begins now and takes 512 keyframes.
    fresh = [index.add(np.array([3], np.int32)) for _ in range(513)]
    assert sorted(fresh[:512]) == list(range(3, 515)) and fresh[512] in old
    assert entries(index, 1) == []


def test_memory_is_bounded_by_the_entries():
    rng, index, kept = np.random.default_rng(0), WordIndex(4000), []
    fixed, largest = index.nbytes, 0.0
    for number in range(2000):
        words = draw(rng, 4000, 60)
        kept.append((index.add(words), len(words)))
        if len(kept) > 400:
            index.remove(kept.pop(0)[0])
        if number >= 400 and number % 50 == 0:
            count = sum(words for _, words in kept)
            largest = max(largest, (index.nbytes - fixed) / (4 * count))
    # With the keyframes of two sweeps that are still in the lists.
    assert largest < 3 * (400 + 2 * 512) / 400
    assert index._slots <= 400 + 2 * 512 + 1


def test_memory_without_removal_is_three_times_the_entries_at_most():
    rng, index = np.random.default_rng(0), WordIndex(4000)
    fixed, count = index.nbytes, 0
    for number in range(600):
        words = draw(rng, 4000, 60)
        count += len(words)
        index.add(words)
        if number % 50 == 0 and number > 100:
            assert index.nbytes - fixed <= 3 * 4 * count
