# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A keyframe database of a few lines, which defines what every other one must answer."""

from __future__ import annotations

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

RADIUS, ELSEWHERE = 3, 10


class ListDatabase:
    """Keyframes in a list, compared one by one in float64; it evicts nothing."""

    def __init__(self, shifts: int, dimensions: int, center: bool = True) -> None:
        self.keyframes: list[Keyframe] = []
        self.center, self.seen = center, 0
        self.sums = np.zeros((shifts, dimensions))
        self.evicted_count = 0
        self.frequency: dict[int, int] = {}
        self.with_words = 0
        self.lengths: list[float] = []

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
        """Return the centered cosine under the best shift, and the index of that shift."""
        means = self.sums / max(self.seen, 1)
        row = keyframe.vector - means[len(means) // 2]
        cosines = [cosine(vector, row) for vector in query.vectors - means]
        best = int(np.argmax(cosines))
        return cosines[best], best

    def weight(self, word: int) -> float:
        """Return the inverse document frequency of a word."""
        twice = 2 * self.with_words + 2
        rare = np.log(twice / (2 * max(self.frequency.get(word, 0), 1) + 1))
        return max(float(rare / np.log(twice / 3)), 0.0)

    def length(self, words: NDArray[np.int32]) -> float:
        """Return the length of the weighted words of an image."""
        return float(np.sqrt(sum(self.weight(word) ** 2 for word in words.tolist())))

    def by_words(self, query: Query, index: int) -> float:
        """Return the cosine of weighted words; a length is that of the time of adding."""
        words = self.keyframes[index].words
        if query.words is None or words is None:
            return 0.0
        common = sum(
            self.weight(word) ** 2 for word in np.intersect1d(query.words, words).tolist()
        )
        lengths = self.lengths[index] * self.length(query.words)
        return common / lengths if lengths > 1e-9 else 0.0

    def search(
        self,
        query: Query,
        k: int,
        *,
        before_ns: int | None = None,
        skip_newest: int = 0,
        without: int | None = None,
        exact: bool = False,
    ) -> SearchResult:
        """Compare with every keyframe."""
        searched = [
            index
            for index, keyframe in enumerate(self.keyframes[: max(len(self) - skip_newest, 0)])
            if before_ns is None or keyframe.clock_ns <= before_ns
        ]
        found = [self.similarity(query, self.keyframes[index]) for index in searched]
        values = np.array([similarity for similarity, _ in found], np.float32)
        if not searched:
            return SearchResult(similarities=values)
        background = Background.of(values)
        words = np.array([self.by_words(query, index) for index in searched], np.float32)
        has_words = query.words is not None and self.with_words > 0
        distinct = distinctness(values, 0.02)
        if has_words:
            distinct = np.hypot(distinct, distinctness(words, 0.01))
        matches = {
            index: self.match(query, index, found[index], distinct, without) for index in searched
        }
        return SearchResult(
            matches=tuple(matches[index] for index in self.best(distinct, k, without)),
            by_words=tuple(matches[index] for index in self.best(words, k, without) if has_words),
            find=lambda index: None if index == without else matches.get(index),
            background=background,
            similarities=distinct / np.float32(8) if has_words else values,
        )

    def best(self, values: NDArray[np.float32], k: int, without: int | None) -> list[int]:
        """Return the indices of the k highest values, of each place at most one."""
        best: list[int] = []
        for index in np.argsort(-values, kind='stable').tolist():
            near = (self.distance(index, chosen) for chosen in best)
            apart = all(steps is None or steps > RADIUS for steps in near)
            if index != without and apart and len(best) < k:
                best.append(index)
        return best

    def match(
        self,
        query: Query,
        index: int,
        found: tuple[float, int],
        distinct: NDArray[np.float32],
        without: int | None,
    ) -> Match:
        """Return the match of a keyframe of which all before it were searched too."""
        ids = self.of_traverse(index)
        rivals = [
            rival
            for rival in np.argsort(-distinct, kind='stable').tolist()
            if rival != without and not self.near_or_same(rival, index)
        ]
        since = [distinct[later] for later in ids if index <= later < len(distinct)]
        stayed = min(since) >= 0.5 * distinct[index]
        return Match(
            keyframe_id=index,
            similarity=found[0],
            shift=found[1],
            distinctness=float(distinct[index]),
            rival_id=rivals[0] if rivals else None,
            rival_distinctness=float(distinct[rivals[0]]) if rivals else 0.0,
            same_visit=bool(stayed) and self.keyframes[index].traverse == query.traverse,
            oldest=len(distinct) >= 8 and index in ids[:2],
        )

    def near_or_same(self, first: int, second: int) -> bool:
        """Return whether two keyframes are too near to be of different places."""
        apart = self.distance(first, second)
        return apart is not None and apart <= ELSEWHERE

    def get(self, keyframe_id: int) -> Keyframe:
        """Return a keyframe."""
        if not 0 <= keyframe_id < len(self):
            raise KeyError(keyframe_id)
        return self.keyframes[keyframe_id]

    def of_traverse(self, keyframe_id: int) -> list[int]:
        """Return the ids of the traverse of a keyframe."""
        traverse = self.get(keyframe_id).traverse
        return [i for i, keyframe in enumerate(self.keyframes) if keyframe.traverse == traverse]

    def near(self, keyframe_id: int, radius: int) -> tuple[int, ...]:
        """Return the ids before and after a keyframe, up to a radius."""
        if not 0 <= keyframe_id < len(self):
            return ()
        ids = self.of_traverse(keyframe_id)
        place = ids.index(keyframe_id)
        return tuple(i for n, i in enumerate(ids) if 1 <= abs(n - place) <= radius)

    def other_visits(self, traverse: int, before_ns: int) -> NDArray[np.int64]:
        """Return the ids of other traverses, and the old ones."""
        ids = [
            index
            for index, keyframe in enumerate(self.keyframes)
            if keyframe.traverse != traverse or keyframe.clock_ns <= before_ns
        ]
        return np.array(ids, np.int64)

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
        if keyframe.words is None:
            self.lengths.append(0.0)
        else:
            self.with_words += 1
            for word in keyframe.words.tolist():
                self.frequency[word] = self.frequency.get(word, 0) + 1
            self.lengths.append(self.length(keyframe.words))
        return Added(len(self) - 1)


def cosine(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the cosine of two vectors, 0 where one has no direction."""
    lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / lengths if lengths > 1e-9 else 0.0


def distinctness(values: NDArray[np.float32], floor: float) -> NDArray[np.float32]:
    """Return how many robust deviations values are above their median."""
    median = np.median(values)
    deviation = 1.4826 * np.median(np.abs(values - median)) + floor
    return np.asarray(np.maximum(values - median, 0) / deviation, np.float32)
