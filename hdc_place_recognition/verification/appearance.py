# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Loop closures by appearance alone, where no keypoint agrees: between seasons, or day and night.

The dense cells of an image are compared with those of a few keyframes of other traverses: the ones
that the database proposes, the ones that paths lead to, and their neighbors. Path evidence decides
(:mod:`path`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from hdc_place_recognition.database.base import KeyframeDatabase, Query
from hdc_place_recognition.features.cells import similarity, UnitCells
from hdc_place_recognition.verification.path import PathMatch
from hdc_place_recognition.verification.state import VerificationState
import numpy as np
from numpy.typing import NDArray

# Neighbors of the best keyframe are compared so many times.
_CLIMBS = 3
# Random keyframes for the background, compared for each new keyframe.
_RANDOM = 2
# Keyframes that are further apart than this are of different places, for the background.
_FAR = 5
# A background of the traverse's own keyframes needs so many.
_LEAST_OWN = 10


@dataclass
class CellComparison:
    """
    The similarity of the dense cells of one image and of keyframes; each is computed once.

    :param query: the image.
    :param database: of the keyframes.
    """

    query: Query
    database: KeyframeDatabase
    _known: dict[int, float] = field(default_factory=dict)

    @property
    def possible(self) -> bool:
        """Return whether the image has cells."""
        return self.query.cells is not None

    @cached_property
    def cells(self) -> UnitCells | None:
        """Return the cells of the image."""
        return None if self.query.cells is None else self.query.cells.unpack()

    def of(self, keyframe_id: int) -> float:
        """Return the similarity D to a keyframe, about 0 to 2; 0 without cells."""
        if keyframe_id not in self._known:
            keyframe = self.database.get(keyframe_id).cells
            cells = self.cells
            if keyframe is None or cells is None:
                return 0.0
            self._known[keyframe_id] = similarity(cells, keyframe)
        return self._known[keyframe_id]

    def between(self, first_id: int, second_id: int) -> float:
        """Return the similarity D of two keyframes, 0 without cells."""
        first, second = (self.database.get(found).cells for found in (first_id, second_id))
        if first is None or second is None:
            return 0.0
        return similarity(first.unpack(), second)


def follow_path(
    comparison: CellComparison,
    proposals: Sequence[int],
    other_visits: NDArray[np.int64],
    state: VerificationState,
) -> PathMatch | None:
    """
    Take an image into the path evidence; return where the path is, None if there is none.

    :param comparison: of the image; it must show something new, since it must not confirm itself.
    :param proposals: ids of the keyframes that the database proposes.
    :param other_visits: ids of the keyframes of other traverses, rising.
    :param state: of the traverse.
    """
    begin = _among(proposals, other_visits)
    ids = {*begin, *state.path.expected(other_visits)}
    for _ in range(_CLIMBS if ids else 0):
        best = max(sorted(ids), key=comparison.of)
        ids.update(_among(comparison.database.near(best, 1), other_visits))
    if not ids:
        return None
    evidence = {found: state.background.z(comparison.of(found)) for found in sorted(ids)}
    best = max(evidence, key=lambda found: evidence[found])
    _learn_background(comparison, other_visits, best, state)
    return state.path.push(other_visits, evidence, begin, comparison.query.novelty)


def _among(ids: Sequence[int], rising: NDArray[np.int64]) -> list[int]:
    """Return those of a few ids that are among many rising ones."""
    ends = np.searchsorted(rising, np.array(ids, np.int64), 'right').tolist()
    return [
        found for found, end in zip(ids, ends, strict=True) if end and rising[end - 1] == found
    ]


def learn_own_background(
    comparison: CellComparison, own: NDArray[np.int64], state: VerificationState
) -> None:
    """
    Learn the similarity of different places from a new keyframe and older ones of its traverse.

    :param own: ids of the keyframes of the traverse that are no longer recent, rising.
    """
    if comparison.possible and len(own) >= _LEAST_OWN:
        for index in state.random.integers(0, len(own), _RANDOM):
            state.background.update(comparison.of(int(own[index])))


def _learn_background(
    comparison: CellComparison,
    other_visits: NDArray[np.int64],
    best: int,
    state: VerificationState,
) -> None:
    for index in state.random.integers(0, len(other_visits), _RANDOM):
        keyframe_id = int(other_visits[index])
        apart = comparison.database.distance(keyframe_id, best)
        if apart is None or apart > _FAR:
            state.background.update(comparison.of(keyframe_id))
