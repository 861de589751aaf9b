# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide which candidates are loop closures."""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.database.base import ELSEWHERE
import numpy as np

_CERTAIN = 1e-12


@dataclass(frozen=True)
class Calibration:
    """
    The logistic function from evidence to the probability of a true loop closure.

    :param slope: positive, so that more evidence never means a lower probability.
    :param center: evidence at which true and false are equally likely.
    """

    slope: float
    center: float

    def score(self, evidence: float) -> float:
        """Return the probability, 0 to 1."""
        return float(1 / (1 + np.exp(-self.slope * (evidence - self.center))))

    def evidence(self, score: float) -> float:
        """Return the evidence that has a score."""
        inside = np.clip(score, _CERTAIN, 1 - _CERTAIN)
        return float(self.center + np.log(inside / (1 - inside)) / self.slope)


@dataclass(frozen=True)
class VerificationSettings:
    """
    The numbers set by hand that decide; `hdc_experiments trust` measured each of them.

    :param full_spread: cells with inliers, of 16, that a recognized scene fills.
    :param least_spread: inliers in fewer cells are one door or poster, which may hang anywhere.
    :param spread_weight: weight of the logarithm of spread.
    :param contrast_weight: weight of the logarithms of the ratios to the best rival, of inliers
        and of distinctness.
    :param chance_inliers: inliers that a rival can have by chance.
    :param same_visit_penalty: cost of a place whose view has not been left since.
    :param oldest_penalty: cost of the oldest keyframes, before which a better match may have been
        seen (3 near misses on lip6_outdoor_part1 backwards).
    :param support_images: images before the query that can support a candidate; one less gives
        full support.
    :param support_reach: keyframes that a match may be off, and that it may move from one image to
        the next.
    :param support_weight: weight of full support.
    :param elsewhere: keyframes further apart than this may be of another place.
    :param certain_inliers: with fewer inliers a rival that is nearly as strong makes the place
        ambiguous.
    :param nearly_as_strong: share of the inliers that a rival needs for that, and that a neighbor
        of the best match needs to be accepted with it.
    :param same_view: similarity of the dense cells of two keyframes that show the same view.
    :param still_agreement: least mean cosine of the cells without inliers where most inliers stay
        at their pixels. On sped_thumbs_part1 29 true pairs have .111 and more, five pairs of
        different webcams with one caption .03 to .107.
    """

    full_spread: int = 8
    least_spread: int = 5
    spread_weight: float = 1.5
    contrast_weight: float = 0.5
    chance_inliers: float = 7.0
    same_visit_penalty: float = 3.0
    oldest_penalty: float = 1.0
    support_images: int = 3
    support_reach: int = 2
    support_weight: float = 0.8
    elsewhere: int = ELSEWHERE
    certain_inliers: float = 40.0
    nearly_as_strong: float = 0.7
    same_view: float = 0.9
    still_agreement: float = 0.12
