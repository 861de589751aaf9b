# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Words of keypoints: what changes them and what does not."""

from hdc_place_recognition.hdc.words import ROOTSIFT_MEAN, SYMBOLS, TABLES, WordHasher, WORDS
import numpy as np
from numpy.typing import NDArray
import pytest


def descriptors(seed: int, count: int = 100) -> NDArray[np.float32]:
    """Return random descriptors, whole numbers of a length of about 255."""
    raw = np.random.default_rng(seed).gamma(0.5, size=(count, 128)) ** 0.5
    return np.rint(raw / np.linalg.norm(raw, axis=1, keepdims=True) * 255).astype(np.float32)


def words(hasher: WordHasher, found: NDArray[np.float32]) -> NDArray[np.int32]:
    return hasher.words(hasher.symbols(found))


def test_the_same_seed_gives_the_same_words():
    found = descriptors(0)
    first, again = (words(WordHasher(seed=3), found) for _ in range(2))
    assert np.array_equal(first, again)
    assert len(np.intersect1d(first, words(WordHasher(seed=4), found))) < 0.1 * len(first)


def test_words_do_not_depend_on_the_order_or_the_length_of_descriptors():
    hasher, found = WordHasher(), descriptors(1)
    expected = words(hasher, found)
    assert np.array_equal(words(hasher, found[::-1].copy()), expected)
    doubled = hasher.symbols(np.minimum(found, 120) * 2)
    assert np.array_equal(doubled, hasher.symbols(np.minimum(found, 120)))


def test_words_rise_and_are_in_range():
    found = words(WordHasher(), descriptors(2))
    assert (np.diff(found) > 0).all() and found.dtype == np.int32
    assert found[0] >= 0 and found[-1] < WORDS == TABLES * SYMBOLS**2
    # Nearly all keypoints differ: each gives one word a table.
    assert len(found) == pytest.approx(100 * TABLES, rel=0.05)


def test_a_symbol_is_the_signed_axis_nearest_to_the_rotated_descriptor():
    hasher, found = WordHasher(), descriptors(3, 20)
    unit = found / np.linalg.norm(found.astype(np.float64), axis=1, keepdims=True)
    centered = unit - ROOTSIFT_MEAN
    generator = np.random.default_rng(0)
    symbols = hasher.symbols(found)
    for table in range(TABLES):
        for part in range(2):
            rotation = np.linalg.qr(generator.standard_normal((128, 128)))[0][: SYMBOLS // 2]
            along = centered @ rotation.T
            signed = np.stack([along, -along], axis=2).reshape(20, -1)
            assert np.array_equal(symbols[:, table, part], signed.argmax(axis=1))


def test_a_word_is_a_bound_pair_of_its_table():
    hasher = WordHasher()
    symbols = np.zeros((1, TABLES, 2), np.uint8)
    symbols[0, 3] = 5, 7
    found = hasher.words(symbols)
    first = SYMBOLS**2 * np.arange(TABLES)
    first[3] += 5 * SYMBOLS + 7
    assert found.tolist() == first.tolist()
    # Role and filler are not the same.
    symbols[0, 3] = 7, 5
    assert not np.array_equal(hasher.words(symbols), found)
    assert len(hasher.words(np.concatenate([symbols, symbols]))) == TABLES


def test_without_keypoints_there_are_no_words():
    assert len(words(WordHasher(), np.empty((0, 128), np.float32))) == 0


def test_descriptors_of_no_length_are_answered():
    assert len(words(WordHasher(), np.zeros((2, 128), np.float32))) == TABLES


def test_nearly_equal_descriptors_share_most_words():
    hasher, found = WordHasher(), descriptors(5)
    change = np.random.default_rng(0).integers(-1, 2, found.shape)
    noisy = np.maximum(found + change, 0).astype(np.float32)
    first, second, unlike = (words(hasher, part) for part in (found, noisy, descriptors(6)))
    shared = len(np.intersect1d(first, second))
    assert shared > 0.5 * len(first) and shared > 10 * len(np.intersect1d(first, unlike))


def test_the_mean_is_that_of_unit_descriptors():
    assert ROOTSIFT_MEAN.shape == (128,) and 0.7 < np.linalg.norm(ROOTSIFT_MEAN) < 1
