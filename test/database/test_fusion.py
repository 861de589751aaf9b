# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Similarities of vectors and words joined, on similarities made by hand."""

from hdc_place_recognition.database import fusion
from hdc_place_recognition.database.base import Background
from hdc_place_recognition.database.fusion import deviations, fuse, VECTOR_FLOOR, WORD_FLOOR
import numpy as np
import pytest


def test_deviations_are_above_the_median_and_have_a_floor():
    values = np.array([0.0, 0.1, 0.1, 0.1, 0.5], np.float32)
    found = deviations(values, Background.of(values), 0.02)
    assert found == pytest.approx([0, 0, 0, 0, 20], abs=1e-4) and found.dtype == np.float32
    spread = Background(9, 0.1, 0.05)
    found = deviations(values, spread, 0.02)
    assert found[4] == pytest.approx(0.4 / (1.4826 * 0.05 + 0.02))


def test_either_source_alone_finds_a_place():
    vector, words = np.zeros(20, np.float32), np.zeros(20, np.float32)
    vector[3], words[9] = 0.4, 0.2
    found = fuse(vector, Background.of(vector), words)
    assert found[3] == pytest.approx(0.4 / VECTOR_FLOOR)
    assert found[9] == pytest.approx(0.2 / WORD_FLOOR) == pytest.approx(found[3])
    assert np.count_nonzero(found) == 2


def test_both_together_are_the_length_of_both():
    vector, words = np.zeros(20, np.float32), np.zeros(20, np.float32)
    vector[3], words[3] = 0.06, 0.04
    assert fuse(vector, Background.of(vector), words)[3] == pytest.approx(5)


def test_without_words_the_vector_decides():
    vector = np.linspace(0, 1, 20, dtype=np.float32)
    background = Background.of(vector)
    assert np.array_equal(
        fuse(vector, background, None), deviations(vector, background, VECTOR_FLOOR)
    )


def test_the_background_of_many_words_is_a_sample(monkeypatch):
    monkeypatch.setattr(fusion, '_SAMPLE', 4)
    words = np.tile(np.array([0.1, 0.9], np.float32), 6)
    zero = np.zeros(12, np.float32)
    # Every third: half of them .1, half .9; so median .5 and deviation .4.
    found = fuse(zero, Background(), words)
    assert found[1] == pytest.approx(0.4 / (1.4826 * 0.4 + WORD_FLOOR), rel=1e-5)
    assert found[0] == 0
