# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What a traverse remembers of its camera: static content, cells, and novelty."""

from __future__ import annotations

from hdc_place_recognition.database.base import Query
from hdc_place_recognition.features.compact import CompactKeypoints
from hdc_place_recognition.hdc.words import WordHasher
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition import traverse as traverse_module
from hdc_place_recognition.recognition.image_encoder import EncodedImage
from hdc_place_recognition.recognition.traverse import Traverse
from hdc_place_recognition.verification.settings import VerificationSettings
import numpy as np
import pytest

PARAMS = Params(dimensions=64)
HASHER = WordHasher()
CAPTION, REST = 20, 60


def new_traverse(number: int = 0) -> Traverse:
    return Traverse(number, PARAMS, VerificationSettings(), HASHER)


def encoded(seed: int, caption: bool = True) -> EncodedImage:
    """Return an image whose first keypoints are those of a caption, the same in every image."""
    parts = []
    for part_seed, count in ((1000 if caption else seed + 2000, CAPTION), (seed, REST)):
        rng = np.random.default_rng(part_seed)
        positions = rng.integers(0, 65536, (count, 2)).astype(np.uint16)
        parts.append((positions, rng.integers(0, 128, (count, 8, 2)).astype(np.uint8)))
    positions, symbols = (np.concatenate(pair) for pair in zip(*parts, strict=True))
    count, rng = len(positions), np.random.default_rng(seed)
    zeros = np.zeros(count, np.uint8)
    vector = rng.standard_normal((1, 64)).astype(np.float32)
    return EncodedImage(
        vectors=vector / np.linalg.norm(vector),
        keypoints=CompactKeypoints(positions, zeros, zeros, np.zeros((count, 64), np.uint8), 0.75),
        symbols=symbols,
        grid=rng.standard_normal((6, 8, 16)).astype(np.float32),
        n_features=48,
    )


def see(traverse: Traverse, seeds: range, count: bool = True, caption: bool = True) -> Query:
    """Return the last query of images with a caption."""
    for seed in seeds:
        query = traverse.query(seed, encoded(seed, caption), PARAMS)
        if count:
            traverse.count_static(query)
    return query


def test_static_keypoints_are_marked_and_give_no_words():
    query = see(new_traverse(), range(4))
    assert query.static[:CAPTION].all() and not query.static[CAPTION:].any()
    image = encoded(3)
    assert np.array_equal(query.words, HASHER.words(image.symbols[CAPTION:]))


def test_nothing_is_static_in_the_first_images_or_without_a_caption():
    for query in (see(new_traverse(), range(2)), see(new_traverse(), range(9), caption=False)):
        assert not query.static.any() and len(query.static) == CAPTION + REST
    assert np.array_equal(query.words, HASHER.words(encoded(8, False).symbols))


def test_only_what_is_counted_is_static():
    assert not see(new_traverse(), range(9), count=False).static.any()


def test_another_traverse_of_the_camera_knows_its_static_content_and_means():
    before, after = new_traverse(), new_traverse(1)
    see(before, range(4))
    after.continue_camera(before)
    query = after.query(9, encoded(9), PARAMS)
    assert query.static[:CAPTION].all() and query.traverse == 1
    fresh = new_traverse(1).query(9, encoded(9), PARAMS)
    assert not np.array_equal(query.cells.codes, fresh.cells.codes)
    assert after.verification.background is before.verification.background
    # But it is not where the other one was.
    assert query.moved and query.novelty == 1


def test_images_that_show_nothing_new_teach_nothing_about_cells():
    still, once = new_traverse(), new_traverse()
    see(once, range(1))
    for _ in range(9):
        see(still, range(1))
    repeated, single = (traverse.query(5, encoded(5), PARAMS) for traverse in (still, once))
    assert np.array_equal(repeated.cells.codes, single.cells.codes)


def test_novelty_is_measured_from_the_last_keyframe():
    traverse, image = new_traverse(), encoded(0)
    assert traverse.query(0, image, PARAMS).novelty == 1
    again = traverse.query(1, image, PARAMS)
    assert again.novelty == pytest.approx(0, abs=1e-6) and not again.moved
    second = encoded(1)
    found = traverse.query(2, second, PARAMS)
    cosine = float(image.vectors[0] @ second.vectors[0])
    assert found.novelty == pytest.approx(min(1 - cosine, 1)) and found.moved


def test_only_the_strongest_keypoints_have_words(monkeypatch):
    monkeypatch.setattr(traverse_module, 'KEYPOINTS', 50)
    traverse, image = new_traverse(), encoded(0)
    few = EncodedImage(image.vectors, image.keypoints, image.symbols[:50], None, 48)
    query = traverse.query(0, few, PARAMS)
    assert np.array_equal(query.words, HASHER.words(image.symbols[:50]))
    assert len(query.static) == CAPTION + REST and query.cells is None


def test_without_keypoints_there_are_no_words():
    traverse = new_traverse()
    bare = EncodedImage(encoded(0).vectors, None, None, None, 48)
    query = traverse.query(0, bare, PARAMS)
    traverse.count_static(query)
    assert query.words is None and query.static is None and query.keypoints is None
