# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Synthetic hypervectors that are hard in the ways real ones are."""

from __future__ import annotations

from hdc_place_recognition.hdc.algebra import Hypervector, normalize
import numpy as np

DIMENSIONS = 4096
SIDE = 5  # displacements in a row and in a column
_FORMS = SIDE * SIDE
# Places are seen several times, and look alike in what they share with others.
_VIEWS, _THEMES = 5, 100
_VIEW_NOISE, _QUERY_NOISE = 0.8, 1.0
# How much of a place is left in forms displaced by 0, 1, 2, ... steps from where it is.
_FADING = np.array([1.0, 0.7, 0.35, 0.15, 0.05, 0.0, 0.0], np.float32)

# Noises that are cut anywhere; a prime that takes successive numbers far from each other.
_CUT, _SCATTERED = 1009, 2_654_435_761


class World:
    """
    Places in clusters, all with a common part: what a database of so many rows may hold.

    :param rows: n.
    :param seed: of everything drawn; rows and queries are the same in any order.
    """

    def __init__(self, rows: int, seed: int = 0) -> None:
        self._rows, self._seed = rows, seed
        rng = np.random.default_rng([seed, 0])
        self._themes = _noise(rng, _THEMES)
        self._common = _noise(rng, _FORMS)

    def row(self, number: int) -> Hypervector:
        """Return (d,), one view of a place."""
        noise = _noise(np.random.default_rng([self._seed, 1, number]), 1)[0]
        own = self._place(number // _VIEWS) + _VIEW_NOISE * noise
        return normalize(own + self._common[_FORMS // 2])

    def query(self, number: int) -> Hypervector:
        """Return (s, d), a known place again, displaced, under all displacements."""
        rng = np.random.default_rng([self._seed, 2, number])
        place = self._place(self._asked(rng))
        y, x = np.divmod(np.arange(_FORMS), SIDE)
        steps = np.hypot(x - rng.integers(SIDE), y - rng.integers(SIDE))
        left = _FADING[np.rint(steps).astype(int)]
        noise = _noise(rng, (SIDE + 1) ** 2).reshape(SIDE + 1, SIDE + 1, -1)
        smooth = noise[:-1, :-1] + noise[1:, :-1] + noise[:-1, 1:] + noise[1:, 1:]
        clutter = _QUERY_NOISE / 2 * smooth.reshape(_FORMS, -1)
        return normalize(left[:, None] * place + clutter + self._common)

    def shows(self, number: int, row: int) -> bool:
        """Return whether a row is a view of the place that a query asks for."""
        rng = np.random.default_rng([self._seed, 2, number])
        return row // _VIEWS == self._asked(rng)

    def _asked(self, rng: np.random.Generator) -> int:
        return int(rng.integers(-(-self._rows // _VIEWS)))

    def _place(self, number: int) -> Hypervector:
        rng = np.random.default_rng([self._seed, 3, number])
        shared = self._themes[rng.integers(_THEMES, size=2)].sum(axis=0)
        return normalize(shared + _noise(rng, 1)[0])


class LargeWorld(World):
    """The same for millions of rows: their random parts are sections of a common noise array."""

    def __init__(self, rows: int, seed: int = 0) -> None:
        super().__init__(rows, seed)
        drawn = _noise(np.random.default_rng([seed, 4]), _CUT)
        self._noise = np.concatenate([drawn, drawn], axis=1)

    def row(self, number: int) -> Hypervector:
        """Return (d,), one view of a place."""
        own = self._place(number // _VIEWS) + _VIEW_NOISE * self._cut(_SCATTERED * number + 1)
        return normalize(own + self._common[_FORMS // 2])

    def _place(self, number: int) -> Hypervector:
        scattered = _SCATTERED * (self._rows + number)
        shared = self._themes[scattered % _THEMES] + self._themes[scattered // _THEMES % _THEMES]
        return normalize(shared + self._cut(scattered))

    def _cut(self, number: int) -> Hypervector:
        start = number // _CUT % DIMENSIONS
        cut: Hypervector = self._noise[number % _CUT, slice(start, start + DIMENSIONS)]
        return cut


def _noise(rng: np.random.Generator, count: int) -> Hypervector:
    """Return (count, d) random vectors of length about 1."""
    return rng.standard_normal((count, DIMENSIONS), np.float32) / np.float32(DIMENSIONS**0.5)
