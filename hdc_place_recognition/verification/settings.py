# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide which candidates are loop closures."""

from __future__ import annotations

from dataclasses import dataclass

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
    r"""
    The numbers that decide. Set by \`hdc_experiments trust\` on the development sets, unless said.

    Matching of keypoints:

    :param ratio: a match is nearer than this share of the distance to the second nearest (Lowe).
    :param vote_tolerance: distance, in widths, within which a match agrees with a similarity
        transform; large, since a similarity transform can not follow parallax.
    :param least_votes: matches needed to vote at all.
    :param least_epipolar: matches needed for a fundamental matrix.
    :param epipolar_pixels: threshold of MAGSAC++, pixels of an image of \`estimator_width\`.
    :param confidence: of the estimator.
    :param iterations: of the estimator at most.

    Evidence of one image:

    :param deviations: a similarity so many robust deviations above the median is fully distinct.
    :param deviation_floor: added to the robust deviation.
    :param background_count: similarities needed to estimate their distribution.
    :param least_distinctness: lower limit of distinctness, and of the similarity of unverified
        candidates.
    :param distinctness_weight: weight of the logarithm of distinctness.
    :param full_spread: cells with inliers, of 16, that a recognized scene fills.
    :param least_spread: inliers in fewer cells are one door or poster, which may hang anywhere.
    :param spread_weight: weight of the logarithm of spread.
    :param edge_penalty: cost of a match at the edge of the keyframes that were searched.

    Other places and other images:

    :param equal_neighbor: a neighbor of the best match is the same place if its geometry is this
        share as strong.
    :param elsewhere: keyframes further than this from the best match may be another place.
    :param clear_lead: lead in evidence over the best match elsewhere that makes an image certain.
    :param support_images: images before the query that can support a candidate.
    :param support_speed: keyframes that a match may move from one image to the next.
    :param support_slack: keyframes that it may be off besides.
    :param support_from: evidence from which an image supports others.
    :param support_full: evidence from which it supports them fully.
    :param support_enough: fully supporting images that give full support.
    :param support_weight: weight of full support.
    :param typical_inliers: inliers of a typical true closure, against which the cost of few
        inliers is reported; does not decide.
    """

    ratio: float = 0.8
    vote_tolerance: float = 0.06
    least_votes: int = 4
    least_epipolar: int = 8
    epipolar_pixels: float = 1.5
    confidence: float = 0.999
    iterations: int = 1000

    deviations: float = 8.0
    deviation_floor: float = 0.02
    background_count: int = 8
    least_distinctness: float = 0.05
    distinctness_weight: float = 0.75
    full_spread: int = 8
    least_spread: int = 5
    spread_weight: float = 1.5
    edge_penalty: float = 1.0

    equal_neighbor: float = 0.7
    elsewhere: int = 10
    clear_lead: float = 0.7
    support_images: int = 3
    support_speed: int = 2
    support_slack: int = 2
    support_from: float = 1.45
    support_full: float = 2.25
    support_enough: float = 2.0
    support_weight: float = 0.8
    typical_inliers: int = 25
