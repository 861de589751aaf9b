# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A keyframe database of a few lines, which defines what every other one must answer."""

from __future__ import annotations

from collections.abc import Iterable

from hdc_place_recognition.database.base import (
    Added,
    Background,
    Keyframe,
    Match,
    Query,
    SearchResult,
)
import numpy as np
from numpy.typing import NDArray

RADIUS = 3


class ListDatabase:
    """Keyframes in a list, compared one by one in float64; it evicts nothing."""

    def __init__(self, shifts: int, dimensions: int, center: bool = True) -> None:
        self.keyframes: list[Keyframe] = []
        self.center, self.seen = center, 0
        self.sums = np.zeros((shifts, dimensions))
        self.evicted_count = 0

    def __len__(self) -> int:
        return len(self.keyframes)

    @property
    def nbytes(self) -> int:
        """Return the bytes of the vectors."""
        return sum(keyframe.vector.nbytes for keyframe in self.keyframes)

    def update_mean(self, query: Query) -> None:
        """Take a query into the mean."""
        if self.center:
            self.sums += query.vectors
            self.seen += 1

    def similarity(self, query: Query, keyframe: Keyframe) -> tuple[float, int]:
        """Return the centered cosine under the best shift, and that shift."""
        means = self.sums / max(self.seen, 1)
        row = keyframe.vector - means[len(means) // 2]
        cosines = [cosine(vector, row) for vector in query.vectors - means]
        return max(cosines), int(np.argmax(cosines))

    def search(
        self,
        query: Query,
        k: int,
        *,
        before_ns: int | None = None,
        skip_newest: int = 0,
        without: int | None = None,
        also: Iterable[int] = (),
        exact: bool = False,
    ) -> SearchResult:
        """Compare with every keyframe."""
        searched = [
            index
            for index, keyframe in enumerate(self.keyframes[: max(len(self) - skip_newest, 0)])
            if before_ns is None or keyframe.clock_ns <= before_ns
        ]
        found = {index: self.similarity(query, self.keyframes[index]) for index in searched}
        matches = {
            index: Match(index, *found[index], self.at_edge(index, searched)) for index in found
        }
        best: list[int] = []
        for index in sorted(found, key=lambda index: (-np.float32(found[index][0]), index)):
            near = (self.distance(index, chosen) for chosen in best)
            apart = all(steps is None or steps > RADIUS for steps in near)
            if index != without and apart and len(best) < k:
                best.append(index)
        others = {near for index in best for near in self.neighbors(index)} | {*also}
        values = np.array([found[index][0] for index in searched], np.float32)
        return SearchResult(
            tuple(matches[index] for index in best),
            {index: matches[index] for index in others - {without} if index in matches},
            Background.of(values),
            values,
        )

    def get(self, keyframe_id: int) -> Keyframe:
        """Return a keyframe."""
        if not 0 <= keyframe_id < len(self):
            raise KeyError(keyframe_id)
        return self.keyframes[keyframe_id]

    def of_traverse(self, keyframe_id: int) -> list[int]:
        """Return the ids of the traverse of a keyframe."""
        traverse = self.get(keyframe_id).traverse
        return [i for i, keyframe in enumerate(self.keyframes) if keyframe.traverse == traverse]

    def at_edge(self, keyframe_id: int, searched: list[int]) -> bool:
        """Return whether a keyframe is one of the first or last two of eight or more."""
        ids = [found for found in self.of_traverse(keyframe_id) if found in searched]
        return len(ids) >= 8 and keyframe_id in (*ids[:2], *ids[-2:])

    def neighbors(self, keyframe_id: int) -> tuple[int, ...]:
        """Return the ids before and after a keyframe."""
        if not 0 <= keyframe_id < len(self):
            return ()
        ids = self.of_traverse(keyframe_id)
        place = ids.index(keyframe_id)
        first, after, end = max(place - 1, 0), place + 1, place + 2
        return (*ids[first:place], *ids[after:end])

    def distance(self, first_id: int, second_id: int) -> int | None:
        """Return how many keyframes two are apart in one traverse."""
        if not (0 <= first_id < len(self) and 0 <= second_id < len(self)):
            return None
        ids = self.of_traverse(first_id)
        if second_id not in ids:
            return None
        return abs(ids.index(first_id) - ids.index(second_id))

    def add(self, keyframe: Keyframe) -> Added:
        """Append a keyframe."""
        self.keyframes.append(keyframe)
        return Added(len(self) - 1)


def cosine(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the cosine of two vectors, 0 where one has no direction."""
    lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / lengths if lengths > 1e-9 else 0.0
