# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Sequences: bound to their places, only the past."""

from hdc_place_recognition.hdc import algebra
from hdc_place_recognition.hdc.sequence import SequenceBundler
import numpy as np
import pytest

IMAGES = algebra.normalize(np.random.default_rng(0).standard_normal((9, 4096)).astype(np.float32))


def run(images: algebra.Hypervector, length: int = 3) -> list[algebra.Hypervector]:
    bundler = SequenceBundler(dimensions=4096, length=length, seed=0)
    return [bundler.push(image) for image in images]


def test_same_sequence_is_the_same():
    first, again = run(IMAGES)[-1], run(IMAGES[3:])[-1]
    # Only the last 3 images count: what came before is forgotten.
    assert np.allclose(first, again)
    assert np.linalg.norm(first) == pytest.approx(1, abs=1e-5)


def test_order_matters():
    forward, backward = run(IMAGES[:3])[-1], run(IMAGES[2::-1])[-1]
    # The middle image keeps its place: a third remains.
    assert algebra.cosine_similarity(forward, backward) == pytest.approx(1 / 3, abs=0.06)


def test_one_image_of_three():
    mixed = np.stack([IMAGES[5], IMAGES[6], IMAGES[2]])
    assert algebra.cosine_similarity(run(IMAGES[:3])[-1], run(mixed)[-1]) == pytest.approx(
        1 / 3, abs=0.06
    )


def test_only_the_past_is_used():
    assert np.array_equal(run(IMAGES[:4])[2], run(IMAGES)[2])


def test_length_one_keeps_similarities():
    vectors = run(IMAGES, length=1)
    assert algebra.cosine_similarity(vectors[0], vectors[1]) == pytest.approx(
        algebra.cosine_similarity(IMAGES[0], IMAGES[1]), abs=1e-6
    )


def test_clear_begins_anew():
    bundler = SequenceBundler(dimensions=4096, length=3, seed=0)
    bundler.push(IMAGES[0])
    bundler.clear()
    assert np.allclose(bundler.push(IMAGES[1]), run(IMAGES[1:2])[0])


def test_images_without_features():
    zero = np.zeros(4096, np.float32)
    assert not run(np.stack([zero, zero]))[-1].any()
