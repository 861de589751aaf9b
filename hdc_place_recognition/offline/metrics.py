# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Metrics of place recognition: pure functions of :class:`Pairs`, each with its definition.

Hard, soft and eligible pairs, and ties, are treated as :mod:`curves` says. Where there is nothing
to be found a metric is ``None``, not 0 and not 1.
"""

from hdc_place_recognition.offline.curves import exact_curve, Pairs, PrecisionRecall
import numpy as np
from numpy.typing import NDArray

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
