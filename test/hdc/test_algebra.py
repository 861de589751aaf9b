# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The algebra: small numbers by hand, and the properties that the paper names."""

from hdc_place_recognition.hdc import algebra
import numpy as np
import pytest

D = 4096


def vectors(count: int, seed: int = 0) -> algebra.Hypervector:
    return algebra.random_vectors(count, D, np.random.default_rng(seed))


def test_bind_bundle_by_hand():
    a = np.array([1, -1, 1, -1], np.float32)
    b = np.array([1, 1, -1, -1], np.float32)
    assert algebra.bind(a, b).tolist() == [1, -1, -1, 1]
    assert algebra.bundle(np.stack([a, b, b])).tolist() == [3, 1, -1, -3]
    assert algebra.cosine_similarity(a, b) == 0
    assert algebra.cosine_similarity(a, algebra.bundle(np.stack([a, b]))) == pytest.approx(
        2 / np.sqrt(8)
    )


def test_random_vectors_are_signs_and_repeat():
    first = vectors(3)
    assert first.shape == (3, D) and first.dtype == np.float32
    assert set(np.unique(first)) == {-1, 1}
    assert np.array_equal(first, vectors(3))
    assert not np.array_equal(first, vectors(3, seed=1))


def test_random_vectors_are_nearly_orthogonal():
    many = vectors(50)
    similarities = algebra.cosine_similarity(many[:, None], many[None])
    off_diagonal = similarities[~np.eye(50, dtype=bool)]
    # Standard deviation 1 / sqrt(4096) = 0.0156; five of them.
    assert np.abs(off_diagonal).max() < 5 / 64
    assert np.allclose(np.diag(similarities), 1)


def test_binding_is_self_inverse_and_unlike_its_inputs():
    a, b = vectors(2)
    assert np.array_equal(algebra.unbind(algebra.bind(a, b), b), a)
    assert abs(algebra.cosine_similarity(algebra.bind(a, b), a)) < 0.08


def test_binding_keeps_similarity():
    rng = np.random.default_rng(2)
    a = rng.standard_normal(D).astype(np.float32)
    b = (a + rng.standard_normal(D)).astype(np.float32)
    key = vectors(1)[0]
    assert algebra.cosine_similarity(algebra.bind(a, key), algebra.bind(b, key)) == pytest.approx(
        algebra.cosine_similarity(a, b), abs=1e-6
    )


def test_a_bundle_is_like_its_parts_and_gives_them_back():
    fillers, roles = vectors(5, seed=3), vectors(5, seed=4)
    bundled = algebra.bundle(algebra.bind(fillers, roles))
    recovered = algebra.cosine_similarity(algebra.unbind(bundled, roles[2]), fillers)
    assert recovered.argmax() == 2 and recovered[2] > 0.4
    assert np.abs(np.delete(recovered, 2)).max() < 0.1


def test_bind_distributes_over_bundle():
    a, b, c = vectors(3)
    left = algebra.bind(a, algebra.bundle(np.stack([b, c])))
    assert np.array_equal(left, algebra.bundle(np.stack([algebra.bind(a, b), algebra.bind(a, c)])))


def test_zero_vectors_are_like_nothing():
    zero = np.zeros(4, np.float32)
    assert algebra.cosine_similarity(zero, zero) == 0
    assert algebra.normalize(zero).tolist() == [0, 0, 0, 0]
    assert algebra.bundle(np.empty((0, 4), np.float32)).tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize(
    ('dimensions', 'last'), [(1000, slice(768, 1000)), (512, slice(256, 512))]
)
def test_blocks_cover_all_dimensions_once(dimensions, last):
    blocks = list(algebra.blocks(dimensions))
    assert blocks[-1] == last
    covered = np.concatenate([np.arange(dimensions)[block] for block in blocks])
    assert np.array_equal(covered, np.arange(dimensions))
