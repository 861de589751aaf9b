# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What the ground truth says of the closures that the recogniser accepted."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray


class Verdict(Enum):
    """What one candidate is by the ground truth; the value is what the tables show."""

    TRUE = 'true'
    FALSE = 'false'
    IGNORED = 'ignored'


@dataclass(frozen=True)
class Closures:
    """
    The accepted candidates counted, each by itself: several may belong to one query.

    :param true: accepted candidates on a hard pair.
    :param false: accepted candidates on a pair that is neither hard nor soft.
    :param ignored: accepted candidates on a pair that is soft only.
    :param queries_with_match: queries that have an eligible hard match.
    :param queries_found: of these, the queries with at least one true accepted candidate.
    """

    true: int
    false: int
    ignored: int
    queries_with_match: int
    queries_found: int

    @property
    def precision(self) -> float | None:
        """Return true / (true + false), or None when nothing that counts was accepted."""
        decided = self.true + self.false
        return self.true / decided if decided else None

    @property
    def recall(self) -> float | None:
        """Return queries_found / queries_with_match, or None when no query has a match."""
        return self.queries_found / self.queries_with_match if self.queries_with_match else None


def judge(
    pairs: Sequence[tuple[int, int]], hard: NDArray[np.bool_], soft: NDArray[np.bool_]
) -> list[Verdict]:
    """
    Return the verdict on each (query, database image) pair.

    :param pairs: row and column of each candidate.
    :param hard: (q, n) bool, the same place: a true closure.
    :param soft: (q, n) bool, perhaps the same place: ignored where it is not hard.
    :return: one verdict a pair, in their order.
    """
    return [
        Verdict.TRUE if hard[pair] else Verdict.IGNORED if soft[pair] else Verdict.FALSE
        for pair in pairs
    ]


def count_closures(
    accepted: Sequence[tuple[int, int]],
    hard: NDArray[np.bool_],
    soft: NDArray[np.bool_],
    has_match: NDArray[np.bool_],
) -> Closures:
    """
    Return the accepted candidates counted by verdict.

    :param accepted: row (query) and column (database image) of each accepted candidate.
    :param hard: (q, n) bool, the same place.
    :param soft: (q, n) bool, perhaps the same place.
    :param has_match: (q,) bool, the queries that have an eligible hard match.
    :return: the counts, from which precision and recall follow.
    """
    verdicts = judge(accepted, hard, soft)
    found = {
        pair[0]
        for pair, verdict in zip(accepted, verdicts, strict=True)
        if verdict is Verdict.TRUE
    }
    return Closures(
        true=verdicts.count(Verdict.TRUE),
        false=verdicts.count(Verdict.FALSE),
        ignored=verdicts.count(Verdict.IGNORED),
        queries_with_match=int(has_match.sum()),
        queries_found=len(found),
    )
