# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Sequences of images as one hypervector (paper, Sec. 3.2.3)."""

from __future__ import annotations

from collections import deque

from hdc_place_recognition.hdc import algebra
from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np


class SequenceBundler:
    """
    Bundles the last images' vectors, each bound to its place in the sequence.

    Place 0 is the current image, 1 the one before it and so on: only the past is used, so that a
    robot can do it (SeqSLAM and the paper's toolbox look at later images too).

    :param length: images in a sequence; until there are so many, those there are.
    """

    def __init__(self, *, dimensions: int, length: int, seed: int) -> None:
        rng = np.random.default_rng([seed, 2])
        self._places = algebra.random_vectors(length, dimensions, rng)
        self._recent: deque[Hypervector] = deque(maxlen=length)

    def push(self, descriptor: Hypervector) -> Hypervector:
        """
        Return the vector of the sequence that ends with this image.

        :param descriptor: (..., d) float32, unit length; of several forms, each by itself.
        :return: (..., d) float32, unit length; zeros if all of the sequence is.
        """
        self._recent.appendleft(descriptor)
        bound = [algebra.bind(*pair) for pair in zip(self._recent, self._places, strict=False)]
        return algebra.normalize(algebra.bundle(np.stack(bound)))

    def clear(self) -> None:
        """Forget the images so far: the next one begins a new sequence."""
        self._recent.clear()
