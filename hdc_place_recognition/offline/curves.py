# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Pairs of images with their ground truth, and exact precision-recall curves over them.

Conventions that hold for every metric (GThard and GTsoft of Schubert and Neubert's tutorial):
a pair in ``hard`` is the same place; a pair in ``soft`` but not in ``hard`` may or may not be, so
it is removed before anything is counted, and never is an extra positive; a pair that is not
``eligible`` was never to be compared (itself, too recent, from the future) and is removed too.
Equal similarities are one step: nothing depends on the order of the images.
"""

from dataclasses import dataclass
from functools import cached_property

from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Pairs:
    """
    All pairs of a query (row) and a database image (column), with what is known of them.

    :param similarities: (q, n) float, higher is closer; only the eligible entries are read.
    :param hard: (q, n) bool, the same place.
    :param soft: (q, n) bool, perhaps the same place; where it is not hard, the pair is ignored.
    :param eligible: (q, n) bool, the pairs that the recogniser was to compare.
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
