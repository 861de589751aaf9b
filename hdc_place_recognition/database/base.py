# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
What the recognizer asks of a keyframe database.

A database is known by the ids of its keyframes only; rows, slots and their order never leave it.
It keeps no state between two calls: the same search gives the same result until a keyframe is
added or the mean is updated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from hdc_place_recognition.features.cells import Cells
from hdc_place_recognition.features.compact import CompactKeypoints
from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np
from numpy.typing import NDArray

# Keyframes that are this near to each other in their traverse show the same place.
PLACE_RADIUS = 3
# Keyframes further apart than this may be of another place.
ELSEWHERE = 10


@dataclass(frozen=True)
class Query:
    """
    An image that is compared with the keyframes.

    :param stamp_ns: header stamp of the image.
    :param vectors: (s, d) float32, the image descriptor under each shift; the middle one is that
        of the zero shift, which is also what a keyframe stores.
    :param keypoints: for geometric verification, None without it.
    :param words: (m,) int32, the words of its keypoints, each once; None without keypoints.
    :param static: (k,) which keypoints are static content; None without keypoints.
    :param pixels: (n, 8) int32, the symbols of its strongest keypoints bound to their pixels, to
        be counted for static content; None without keypoints.
    :param cells: dense cells, None if the local features are no grid.
    :param traverse: number of its traverse.
    :param novelty: 1 - cosine with the last keyframe, 0 to 1.
    :param moved: whether it shows something new, rather than what the last keyframe shows.
    """

    stamp_ns: int
    vectors: Hypervector
    keypoints: CompactKeypoints | None = None
    words: NDArray[np.int32] | None = None
    static: NDArray[np.bool_] | None = None
    pixels: NDArray[np.int32] | None = None
    cells: Cells | None = None
    traverse: int = 0
    novelty: float = 1.0
    moved: bool = True

    @property
    def unshifted(self) -> Hypervector:
        """Return (d,), the descriptor under the zero shift."""
        return self.vectors[len(self.vectors) // 2]

    @property
    def empty(self) -> bool:
        """Return whether the image had no features that could be encoded."""
        return not self.vectors.any()


@dataclass(frozen=True, slots=True)
class Keyframe:
    """
    A stored image.

    :param stamp_ns: header stamp of the image.
    :param clock_ns: the same moment on a clock that never goes back, and stands still with the
        robot.
    :param vector: (d,) float32, the image descriptor.
    :param keypoints: for geometric verification, None without it.
    :param words: (m,) int32, the words of its keypoints, each once; None without keypoints, and
        where the keyframe comes from a database, which keeps an index of them only.
    :param cells: dense cells, None if the local features are no grid.
    :param traverse: number of the traverse; keyframes of one traverse follow each other.
    :param twin: id of the older keyframe that is most similar to it, None if there is none.
    """

    stamp_ns: int
    clock_ns: int
    vector: Hypervector
    keypoints: CompactKeypoints | None = None
    words: NDArray[np.int32] | None = None
    cells: Cells | None = None
    traverse: int = 0
    twin: int | None = None


@dataclass(frozen=True, slots=True)
class Match:
    """
    A keyframe compared with a query.

    :param keyframe_id: its id.
    :param similarity: centered cosine of the vectors under the best shift, -1 to 1.
    :param shift: index of the best shift; the zero shift if it was not compared exactly.
    :param distinctness: of vector and words together, deviations above the background.
    :param rival_id: the most distinct keyframe of another place, None if there is none.
    :param rival_distinctness: its distinctness.
    :param same_visit: whether the view has not been left since: every keyframe since then that was
        searched is at least half as distinct.
    :param oldest: whether it is one of the two oldest keyframes of its traverse, of eight or more
        that were searched.
    """

    keyframe_id: int
    similarity: float
    shift: int
    distinctness: float = 0.0
    rival_id: int | None = None
    rival_distinctness: float = 0.0
    same_visit: bool = False
    oldest: bool = False


@dataclass(frozen=True)
class Background:
    """
    The distribution of the similarities of a query to all keyframes that were searched.

    :param count: number of values that it was estimated from.
    :param median: their median.
    :param deviation: the median of their absolute deviations from it.
    """

    count: int = 0
    median: float = 0.0
    deviation: float = 0.0

    @classmethod
    def of(cls, similarities: NDArray[np.float32]) -> Background:
        """Describe similarities (n,) by their distribution."""
        if not len(similarities):
            return cls()
        median = float(np.median(similarities))
        deviation = float(np.median(np.abs(similarities - median)))
        return cls(len(similarities), median, deviation)


def _nothing(keyframe_id: int) -> None:
    """Return that a keyframe was not searched."""
    del keyframe_id


@dataclass(frozen=True)
class SearchResult:
    """
    The keyframes most similar to a query.

    :param matches: the most distinct first, at most one for each place: keyframes next to a better
        one of the same traverse are left out.
    :param by_words: likewise, by the similarity of words alone.
    :param find: returns the match of any keyframe, None if it was not searched; valid until the
        database changes.
    :param background: of the similarities of the vectors of all keyframes that were searched.
    :param similarities: (n,) float32, of each keyframe that was searched, in the order of their
        ids: of vector and words together (0 to about 2), or of the vectors alone (-1 to 1) where
        there are no words. None from a database that does not compare with all.
    """

    matches: tuple[Match, ...] = ()
    by_words: tuple[Match, ...] = ()
    find: Callable[[int], Match | None] = _nothing
    background: Background = Background()
    similarities: NDArray[np.float32] | None = None


@dataclass(frozen=True)
class Added:
    """
    What became of a keyframe that was to be stored.

    :param keyframe_id: its id, None if a full database did not take it.
    :param evicted: ids of the keyframes that were evicted for it.
    """

    keyframe_id: int | None = None
    evicted: tuple[int, ...] = ()


class KeyframeDatabase(Protocol):
    """Stores keyframes and finds those most similar to a query."""

    def __len__(self) -> int:
        """Return the number of keyframes stored."""

    @property
    def nbytes(self) -> int:
        """Return the bytes of memory that the keyframes take."""

    @property
    def evicted_count(self) -> int:
        """Return how many keyframes were evicted or not taken since the start."""

    def update_mean(self, query: Query) -> None:
        """Take an image into the mean that is subtracted before vectors are compared."""

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
        """
        Return the k most distinct keyframes, of equal ones the older first.

        :param query: the image.
        :param k: number of matches at most.
        :param before_ns: search only keyframes of this clock time or earlier.
        :param skip_newest: leave out this many newest keyframes of the database.
        :param without: id of a keyframe that is no match, such as the query's own.
        :param exact: compare with every keyframe, whatever their number.
        """

    def get(self, keyframe_id: int) -> Keyframe:
        """
        Return a keyframe.

        :raises KeyError: there is none with this id, or it was evicted.
        """

    def distance(self, first_id: int, second_id: int) -> int | None:
        """
        Return how many keyframes two are apart in their traverse.

        :return: None for keyframes of different traverses, and where one was evicted.
        """

    def near(self, keyframe_id: int, radius: int) -> tuple[int, ...]:
        """Return the ids up to so many keyframes before and after one in its traverse, rising."""

    def other_visits(self, traverse: int, before_ns: int) -> NDArray[np.int64]:
        """Return the ids of other traverses, and those of this clock time or before, rising."""

    def add(self, keyframe: Keyframe) -> Added:
        """
        Store a keyframe; evict redundant ones while the database is over its capacity.

        :raises PlaceRecognitionError: there is no storage for it; nothing is changed.
        """
