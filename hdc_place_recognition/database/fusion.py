# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Joins the similarities of independent sources: the position-bound vector and the words.

Each source is compared with its own background. The joint distinctness of a keyframe is the length
of both deviations, so that either source alone can find a place. A sum would let the noise of one
source hide what the other finds (on stromovka_part1 it loses).
"""

from __future__ import annotations

from hdc_place_recognition.database.base import Background
import numpy as np
from numpy.typing import NDArray

# Least deviation of the similarities of a query: of vectors, and of words. Without it, anything
# would stand out in a small database or among equal values.
VECTOR_FLOOR, WORD_FLOOR = 0.02, 0.01
# Deviations that count as a similarity of 1.
FULL_DEVIATIONS = 8.0
_MAD_TO_DEVIATION = 1.4826
# Similarities that the background of a large database is estimated from.
_SAMPLE = 4096


def deviations(
    similarities: NDArray[np.float32], background: Background, floor: float
) -> NDArray[np.float32]:
    """
    Return how many robust deviations similarities are above the median of their background.

    :param similarities: (n,).
    :param background: of the similarities to all keyframes.
    :param floor: added to the deviation.
    :return: (n,), not negative: max(s - median, 0) / (1.4826 MAD + floor).
    """
    deviation = _MAD_TO_DEVIATION * background.deviation + floor
    return np.asarray(np.maximum(similarities - background.median, 0) / deviation, np.float32)


def fuse(
    vector: NDArray[np.float32], background: Background, words: NDArray[np.float32] | None
) -> NDArray[np.float32]:
    """
    Return the joint distinctness of keyframes, in deviations.

    :param vector: (n,) similarities of vectors.
    :param background: of these.
    :param words: (n,) similarities of words, None without words.
    :return: (n,) float32, not negative.
    """
    by_vector = deviations(vector, background, VECTOR_FLOOR)
    if words is None:
        return by_vector
    step = max(len(words) // _SAMPLE, 1)
    by_words = deviations(words, Background.of(words[::step]), WORD_FLOOR)
    return np.asarray(np.hypot(by_vector, by_words), np.float32)
