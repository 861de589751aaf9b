# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What the ground truth says of the closures that the recognizer accepted."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

from hdc_place_recognition.errors import PlaceRecognitionError
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


@dataclass(frozen=True)
class Pairs:
    """
    All pairs of a query (row) and a database image (column), with what is known of them.

    :param similarities: (q, n) float, higher is closer; only the eligible entries are read.
    :param hard: (q, n) bool, the same place.
    :param soft: (q, n) bool, perhaps the same place; where it is not hard, the pair is ignored.
    :param eligible: (q, n) bool, the pairs that the recognizer was to compare.
    :raises PlaceRecognitionError: if the shapes differ or an eligible similarity is NaN.
    """

    similarities: NDArray[np.float32]
    hard: NDArray[np.bool_]
    soft: NDArray[np.bool_]
    eligible: NDArray[np.bool_]

    def __post_init__(self) -> None:
        """Check that the four matrices fit together."""
        shape = self.similarities.shape
        for name in ('hard', 'soft', 'eligible'):
            if getattr(self, name).shape != shape:
                raise PlaceRecognitionError(
                    f'{name} has shape {getattr(self, name).shape}, but the similarities have '
                    f'shape {shape}: all need one row a query and one column a database image'
                )
        if np.isnan(self.similarities[self.eligible]).any():
            raise PlaceRecognitionError(
                'a similarity of an eligible pair is NaN: give -1 to what can not be found'
            )

    @cached_property
    def positive(self) -> NDArray[np.bool_]:
        """Return (q, n) bool: the pairs to be found, hard and eligible."""
        return self.hard & self.eligible

    @cached_property
    def counted(self) -> NDArray[np.bool_]:
        """Return (q, n) bool: the pairs that count at all, eligible and not soft only."""
        return self.eligible & (self.hard | ~self.soft)

    @cached_property
    def has_match(self) -> NDArray[np.bool_]:
        """Return (q,) bool: the queries that have at least one eligible hard match."""
        return np.asarray(self.positive.any(axis=1))


@dataclass(frozen=True)
class PrecisionRecall:
    """
    A precision-recall curve, one point a distinct threshold, thresholds falling.

    :param thresholds: (t,) float; a pair is retrieved if its similarity is not below it.
    :param precision: (t,) float in [0, 1], true retrieved / retrieved.
    :param recall: (t,) float in [0, 1], true retrieved / all true; rising.
    """

    thresholds: NDArray[np.float64]
    precision: NDArray[np.float64]
    recall: NDArray[np.float64]

    def steps(self) -> 'PrecisionRecall':
        """Return only the points at which recall rises: they alone make up the area."""
        rises = np.diff(self.recall, prepend=0.0) > 0
        return PrecisionRecall(self.thresholds[rises], self.precision[rises], self.recall[rises])

    @property
    def area(self) -> float:
        """Return sum over n of (R_n - R_{n-1}) * P_n with R_0 = 0: steps, no interpolation."""
        return float(np.diff(self.recall, prepend=0.0) @ self.precision)

    @property
    def recall_at_full_precision(self) -> float:
        """Return the largest recall among the points of precision 1, or 0 if there is none."""
        return float(self.recall[self.precision == 1.0].max(initial=0.0))


def exact_curve(
    scores: NDArray[np.float32], correct: NDArray[np.bool_], n_positive: int
) -> PrecisionRecall | None:
    """
    Return the curve whose thresholds are all distinct scores.

    :param scores: (n,) float, higher is retrieved first; equal scores are retrieved together.
    :param correct: (n,) bool, whether retrieving this one is right.
    :param n_positive: how many there are to be found, the denominator of recall.
    :return: the curve, or None if there is nothing to be found.
    """
    if n_positive == 0:
        return None
    order = np.argsort(-scores, kind='stable')
    falling = scores[order]
    last_of_tie = np.flatnonzero(np.diff(falling, append=-np.inf))
    true = np.cumsum(correct[order])[last_of_tie]
    return PrecisionRecall(
        falling[last_of_tie].astype(np.float64), true / (last_of_tie + 1), true / n_positive
    )


AUTHORS_THRESHOLDS = 100  # of the authors' Python port, for average_precision_100 alone


def precision_recall(pairs: Pairs) -> PrecisionRecall | None:
    """
    Return the exact precision-recall curve over all counted pairs of the matrix.

    Every distinct similarity s is a threshold; with B the counted pairs of similarity >= s:
    ``P = |B and hard| / |B|`` and ``R = |B and hard| / |hard|``.

    :param pairs: similarities and ground truth.
    :return: the curve, or None if no counted pair is hard.
    """
    counted = pairs.counted
    return exact_curve(
        pairs.similarities[counted], pairs.positive[counted], int(pairs.positive.sum())
    )


def average_precision(pairs: Pairs) -> float | None:
    """
    Return the area under the exact curve of all pairs: sum of (R_n - R_{n-1}) * P_n, R_0 = 0.

    The sum is step-wise (the precision reached counts for the whole step), without interpolation
    and without an invented point at recall 0.

    :param pairs: similarities and ground truth.
    :return: the average precision in (0, 1], or None if no counted pair is hard.
    """
    curve = precision_recall(pairs)
    return curve.area if curve else None


def average_precision_100(pairs: Pairs) -> float | None:
    """
    Return the average precision as the authors' Python port counts it, for comparisons only.

    100 thresholds spaced equally from the largest to the smallest similarity of a counted pair,
    a point (R, P) = (0, 1) put in front, area by the trapezoid rule. It depends on the spread of
    the similarities and usually differs from :func:`average_precision` by some hundredths.

    :param pairs: similarities and ground truth.
    :return: the area, or None if no counted pair is hard.
    """
    curve = precision_recall(pairs)
    if curve is None:
        return None
    falling = curve.thresholds
    grid = np.linspace(falling[0], falling[-1], AUTHORS_THRESHOLDS)
    points = np.searchsorted(-falling, -grid, side='right') - 1
    recall = np.concatenate([[0.0], curve.recall[points]])
    precision = np.concatenate([[1.0], curve.precision[points]])
    return float(np.diff(recall) @ (precision[1:] + precision[:-1]) / 2)


def recall_at_k(pairs: Pairs, k: int) -> float | None:
    """
    Return the share of queries whose k best database images contain a hard match.

    Soft-only pairs are removed from the ranking first, queries without a hard match are dropped:
    ``R@k = |{q: rank of the best hard match of q <= k}| / |{q: q has a hard match}|``. A wrong
    image as similar as the best hard match is ranked before it.

    :param pairs: similarities and ground truth.
    :param k: how many best matches are looked at, at least 1.
    :return: the recall in [0, 1], or None if no query has a hard match.
    """
    if not pairs.has_match.any():
        return None
    best = _row_max(pairs.similarities, pairs.positive)
    wrong = pairs.counted & ~pairs.hard
    before = np.count_nonzero(wrong & (pairs.similarities >= best[:, None]), axis=1)
    return float(np.mean(before[pairs.has_match] < k))


def best_match_curve(pairs: Pairs) -> PrecisionRecall | None:
    """
    Return the exact curve over the single best match of every query.

    After removing soft-only pairs, each query retrieves its most similar database image (a wrong
    image as similar as a hard one wins). At threshold s, with B the queries whose best similarity
    is >= s: ``P = |{q in B: best match hard}| / |B|``, and
    ``R = |{q in B: best match hard}| / |{q: q has a hard match}|``.

    :param pairs: similarities and ground truth.
    :return: the curve, or None if no query has a hard match.
    """
    asked = pairs.counted.any(axis=1)
    right = _row_max(pairs.similarities, pairs.positive)[asked]
    wrong = _row_max(pairs.similarities, pairs.counted & ~pairs.hard)[asked]
    return exact_curve(np.maximum(right, wrong), right > wrong, int(pairs.has_match.sum()))


def area_best_match(pairs: Pairs) -> float | None:
    """
    Return the step-wise area under :func:`best_match_curve`, or None if nothing can be found.

    :param pairs: similarities and ground truth.
    :return: the area in [0, 1]; it stays below 1 where a best match is wrong.
    """
    curve = best_match_curve(pairs)
    return curve.area if curve else None


def recall_at_full_precision(pairs: Pairs) -> float | None:
    """
    Return the largest recall of :func:`best_match_curve` at which the precision is exactly 1.

    :param pairs: similarities and ground truth.
    :return: the recall in [0, 1] (0 if already the highest similarity is wrong), or None.
    """
    curve = best_match_curve(pairs)
    return curve.recall_at_full_precision if curve else None


def _row_max(similarities: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return (q,) the largest masked similarity of every row, -inf where nothing is masked."""
    best: NDArray[np.float32] = similarities.max(axis=1, where=mask, initial=-np.inf)
    return best
