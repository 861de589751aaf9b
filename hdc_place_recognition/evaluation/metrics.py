# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Metrics of place recognition against ground truth.

Two groups: counts of accepted closures (:func:`count_closures`), and precision-recall curves over
all pairs or over the best match of each query (:class:`Pairs` and below).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray


class Label(Enum):
    """The ground-truth label of a candidate; the value is written to candidates.csv."""

    TRUE = 'true'
    FALSE = 'false'
    IGNORED = 'ignored'


@dataclass(frozen=True)
class Closures:
    """
    Counts of accepted candidates; a query can have several.

    :param true: accepted candidates of hard pairs.
    :param false: accepted candidates of pairs that are neither hard nor soft.
    :param ignored: accepted candidates of pairs that are soft only.
    :param queries_with_match: queries that have an eligible hard pair.
    :param queries_found: queries with an eligible hard pair and a true accepted candidate.
    """

    true: int
    false: int
    ignored: int
    queries_with_match: int
    queries_found: int

    @property
    def precision(self) -> float | None:
        """Return true / (true + false), None if both are 0."""
        decided = self.true + self.false
        return self.true / decided if decided else None

    @property
    def recall(self) -> float | None:
        """Return queries_found / queries_with_match, None if no query has a match."""
        return self.queries_found / self.queries_with_match if self.queries_with_match else None


def label_matches(
    pairs: Sequence[tuple[int, int]], hard: NDArray[np.bool_], soft: NDArray[np.bool_]
) -> list[Label]:
    """
    Label (query, database image) pairs by ground truth.

    :param pairs: row and column of each candidate.
    :param hard: (q, n) bool, pairs of the same place.
    :param soft: (q, n) bool, pairs that may show the same place; ignored if not hard.
    :return: one label per pair, in the same order.
    """
    return [
        Label.TRUE if hard[pair] else Label.IGNORED if soft[pair] else Label.FALSE
        for pair in pairs
    ]


def count_closures(
    accepted: Sequence[tuple[int, int]],
    hard: NDArray[np.bool_],
    soft: NDArray[np.bool_],
    has_match: NDArray[np.bool_],
) -> Closures:
    """
    Count the accepted candidates by label.

    :param accepted: row (query) and column (database image) of each accepted candidate.
    :param hard: (q, n) bool, pairs of the same place.
    :param soft: (q, n) bool, pairs that may show the same place.
    :param has_match: (q,) bool, queries that have an eligible hard pair.
    """
    labels = label_matches(accepted, hard, soft)
    found = {pair[0] for pair, label in zip(accepted, labels, strict=True) if label is Label.TRUE}
    return Closures(
        true=labels.count(Label.TRUE),
        false=labels.count(Label.FALSE),
        ignored=labels.count(Label.IGNORED),
        queries_with_match=int(has_match.sum()),
        queries_found=len(found),
    )


@dataclass(frozen=True)
class Pairs:
    """
    Similarities and ground truth of all pairs of a query (row) and a database image (column).

    :param similarities: (q, n) float, higher is more similar; only eligible entries are read.
    :param hard: (q, n) bool, pairs of the same place.
    :param soft: (q, n) bool, pairs that may show the same place; ignored if not hard.
    :param eligible: (q, n) bool, pairs that the recognizer should compare.
    :raises PlaceRecognitionError: the shapes differ, or an eligible similarity is NaN.
    """

    similarities: NDArray[np.float32]
    hard: NDArray[np.bool_]
    soft: NDArray[np.bool_]
    eligible: NDArray[np.bool_]

    def __post_init__(self) -> None:
        """Check the shapes and the eligible similarities."""
        shape = self.similarities.shape
        for name in ('hard', 'soft', 'eligible'):
            if getattr(self, name).shape != shape:
                raise PlaceRecognitionError(
                    f'{name} has shape {getattr(self, name).shape}, but the similarities have '
                    f'shape {shape}: all need one row per query and one column per database image'
                )
        if np.isnan(self.similarities[self.eligible]).any():
            raise PlaceRecognitionError(
                'a similarity of an eligible pair is NaN: use -1 for images that cannot be found'
            )

    @cached_property
    def positive(self) -> NDArray[np.bool_]:
        """Return (q, n) bool, the pairs to be found: hard and eligible."""
        return self.hard & self.eligible

    @cached_property
    def counted(self) -> NDArray[np.bool_]:
        """Return (q, n) bool, the pairs that are not ignored: eligible and not soft only."""
        return self.eligible & (self.hard | ~self.soft)

    @cached_property
    def has_match(self) -> NDArray[np.bool_]:
        """Return (q,) bool, the queries that have an eligible hard pair."""
        return np.asarray(self.positive.any(axis=1))


@dataclass(frozen=True)
class PrecisionRecall:
    """
    A precision-recall curve with one point per distinct threshold.

    :param thresholds: (t,) float, decreasing; pairs at or above the threshold are retrieved.
    :param precision: (t,) float in [0, 1], correct retrieved / retrieved.
    :param recall: (t,) float in [0, 1], correct retrieved / all correct; not decreasing.
    """

    thresholds: NDArray[np.float64]
    precision: NDArray[np.float64]
    recall: NDArray[np.float64]

    def steps(self) -> PrecisionRecall:
        """Return the points at which recall increases; they determine the area."""
        rises = np.diff(self.recall, prepend=0.0) > 0
        return PrecisionRecall(self.thresholds[rises], self.precision[rises], self.recall[rises])

    @property
    def area(self) -> float:
        """Return the sum over n of (R_n - R_{n-1}) * P_n with R_0 = 0, without interpolation."""
        return float(np.diff(self.recall, prepend=0.0) @ self.precision)

    @property
    def recall_at_full_precision(self) -> float:
        """Return the largest recall of a point with precision 1, 0 if there is no such point."""
        return float(self.recall[self.precision == 1.0].max(initial=0.0))


def exact_curve(
    scores: NDArray[np.float32], correct: NDArray[np.bool_], n_positive: int
) -> PrecisionRecall | None:
    """
    Return the curve that uses every distinct score as a threshold.

    :param scores: (n,) float; items of equal score are retrieved together.
    :param correct: (n,) bool, True if the item is correct.
    :param n_positive: number of items to be found, the denominator of recall.
    :return: the curve, None if `n_positive` is 0.
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


def precision_recall(pairs: Pairs) -> PrecisionRecall | None:
    """
    Return the exact precision-recall curve over all pairs that are not ignored.

    Every distinct similarity s is a threshold. With B the pairs of similarity >= s:
    ``P = |B and hard| / |B|`` and ``R = |B and hard| / |hard|``.

    :param pairs: similarities and ground truth.
    :return: the curve, None if no eligible pair is hard.
    """
    counted = pairs.counted
    return exact_curve(
        pairs.similarities[counted], pairs.positive[counted], int(pairs.positive.sum())
    )


def average_precision(pairs: Pairs) -> float | None:
    """
    Return the average precision: the sum over n of (R_n - R_{n-1}) * P_n with R_0 = 0.

    The definition is that of scikit-learn's average_precision_score: step-wise, without
    interpolation, and without an added point at recall 0.

    :param pairs: similarities and ground truth.
    :return: average precision in (0, 1], None if no eligible pair is hard.
    """
    curve = precision_recall(pairs)
    return curve.area if curve else None


def average_precision_100(pairs: Pairs) -> float | None:
    """
    Return the average precision as in the authors' Python port, for comparison only.

    It uses 100 equally spaced thresholds from the largest to the smallest similarity, an added
    point (R, P) = (0, 1), and the trapezoid rule. It depends on the distribution of similarities
    and usually differs from :func:`average_precision` by a few hundredths.

    :param pairs: similarities and ground truth.
    :return: the area, None if no eligible pair is hard.
    """
    curve = precision_recall(pairs)
    if curve is None:
        return None
    thresholds = curve.thresholds
    grid = np.linspace(thresholds[0], thresholds[-1], 100)
    points = np.searchsorted(-thresholds, -grid, side='right') - 1
    recall = np.concatenate([[0.0], curve.recall[points]])
    precision = np.concatenate([[1.0], curve.precision[points]])
    return float(np.diff(recall) @ (precision[1:] + precision[:-1]) / 2)


def recall_at_k(pairs: Pairs, k: int) -> float | None:
    """
    Return the share of queries with a hard match among the k most similar images.

    ``R@k = |{q: rank of the best hard match of q <= k}| / |{q: q has a hard match}|``. Soft-only
    pairs are not ranked. A wrong image of equal similarity is ranked before a hard match.

    :param pairs: similarities and ground truth.
    :param k: number of images, at least 1.
    :return: recall in [0, 1], None if no query has a hard match.
    """
    if not pairs.has_match.any():
        return None
    best = _row_max(pairs.similarities, pairs.positive)
    wrong = pairs.counted & ~pairs.hard
    n_before = np.count_nonzero(wrong & (pairs.similarities >= best[:, None]), axis=1)
    return float(np.mean(n_before[pairs.has_match] < k))


def best_match_curve(pairs: Pairs) -> PrecisionRecall | None:
    """
    Return the exact curve over the best match of each query.

    Each query retrieves its most similar image. Soft-only pairs are removed; at equal similarity
    the wrong image is retrieved. With B the queries whose best similarity is >= s:
    ``P = |{q in B: best match hard}| / |B|`` and
    ``R = |{q in B: best match hard}| / |{q: q has a hard match}|``.

    :param pairs: similarities and ground truth.
    :return: the curve, None if no query has a hard match.
    """
    compared = pairs.counted.any(axis=1)
    right = _row_max(pairs.similarities, pairs.positive)[compared]
    wrong = _row_max(pairs.similarities, pairs.counted & ~pairs.hard)[compared]
    return exact_curve(np.maximum(right, wrong), right > wrong, int(pairs.has_match.sum()))


def area_best_match(pairs: Pairs) -> float | None:
    """
    Return the step-wise area under :func:`best_match_curve`.

    :param pairs: similarities and ground truth.
    :return: area in [0, 1], None if no query has a hard match.
    """
    curve = best_match_curve(pairs)
    return curve.area if curve else None


def recall_at_full_precision(pairs: Pairs) -> float | None:
    """
    Return the largest recall of :func:`best_match_curve` at precision 1.

    :param pairs: similarities and ground truth.
    :return: recall in [0, 1], None if no query has a hard match.
    """
    curve = best_match_curve(pairs)
    return curve.recall_at_full_precision if curve else None


def _row_max(similarities: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return (q,) float32, the largest similarity of each row within the mask, -inf if none."""
    best: NDArray[np.float32] = similarities.max(axis=1, where=mask, initial=-np.inf)
    return best
