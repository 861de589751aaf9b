# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
The score of a candidate: the probability that it shows the same place.

Evidence is a sum of logarithms, so each term asks for something of its own. Only slope and center
of the score are fitted: a logistic regression on the same terms relied on the best term of one
data set and failed on the next.

=========== ========================================================= ==========================
term        formula                                                   question
=========== ========================================================= ==========================
inliers     log(1 + inliers)                                          do keypoints agree?
spread      1.5 log(min(spread, 8) / 8)                               all over the image?
rival       .5 log((inliers + 1) / (max(rival inliers, 7) + 1))       more than at other places?
distinct    .5 log((z + 1) / (z of rival + 1))                        found by more than chance?
same visit  -3 if the view has not been left since                    is it another visit?
oldest      -1 for the oldest keyframes                               might others fit better?
support     .8 mean of the probabilities of 2 of the last 3 images    did they agree?
=========== ========================================================= ==========================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hdc_place_recognition.database.base import Match
from hdc_place_recognition.results import Reason
from hdc_place_recognition.verification.geometry import Geometry
from hdc_place_recognition.verification.settings import Calibration, VerificationSettings
import numpy as np

# Values of the terms for a typical true closure, against which the cost of a term is reported:
# medians over the accepted closures of the development sets.
_TYPICAL_INLIERS, _TYPICAL_RIVAL, _TYPICAL_DISTINCT, _TYPICAL_SUPPORT = 4.1, 1.0, 0.3, 0.4
# Unverified candidates: deviations that are fully distinct, and the least that counts.
_FULL_DEVIATIONS, _LEAST = 8.0, 0.05
# Similarities needed to estimate their distribution.
_LEAST_BACKGROUND = 8


@dataclass(frozen=True)
class Term:
    """
    A named part of the evidence.

    :param reason: why a candidate is not accepted if this term costs most.
    :param value: added to the evidence.
    :param typical: value for a typical true closure.
    """

    reason: Reason
    value: float
    typical: float = 0.0

    @property
    def cost(self) -> float:
        """Return how much evidence is missing against a typical true closure."""
        return self.typical - self.value


@dataclass(frozen=True)
class Evidence:
    """
    What is known of one candidate.

    :param image: terms of the query image alone.
    :param support: term of the images before it.
    :param ambiguous: whether another place is nearly as good and neither is beyond doubt.
    """

    image: tuple[Term, ...]
    support: Term
    ambiguous: bool = False

    @property
    def of_image(self) -> float:
        """Return the evidence of the query image alone."""
        return float(sum(term.value for term in self.image))

    @property
    def total(self) -> float:
        """Return the evidence with the support of the images before."""
        return self.of_image + self.support.value

    @property
    def reason(self) -> Reason:
        """Return the reason of the term that cost most."""
        if self.ambiguous:
            return Reason.ANOTHER_PLACE
        return max((*self.image, self.support), key=lambda term: term.cost).reason


class Scorer:
    """
    Weighs evidence.

    :param settings: the numbers that decide.
    :param verified: probability of candidates with geometry.
    :param unverified: probability of candidates without.
    """

    def __init__(
        self, settings: VerificationSettings, verified: Calibration, unverified: Calibration
    ) -> None:
        self.settings = settings
        self.verified, self.unverified = verified, unverified

    def evidence(
        self,
        match: Match,
        geometry: Geometry,
        *,
        rival_inliers: float,
        rival_distinctness: float,
        support: float,
    ) -> Evidence:
        """
        Return the evidence for a verified candidate.

        :param match: found by the database.
        :param geometry: of its keypoints, without static content.
        :param rival_inliers: the highest strength of another place, 0 if none was verified.
        :param rival_distinctness: the highest distinctness of another place.
        :param support: by the images before, 0 to 1.
        """
        settings, strength = self.settings, geometry.strength
        spread = np.clip(geometry.spread, 1, settings.full_spread) / settings.full_spread
        rival = (strength + 1) / (max(rival_inliers, settings.chance_inliers) + 1)
        distinct = (match.distinctness + 1) / (rival_distinctness + 1)
        contrast = settings.contrast_weight
        terms: tuple[Term, ...] = (
            Term(Reason.FEW_INLIERS, float(np.log1p(strength)), _TYPICAL_INLIERS),
            Term(Reason.NO_SPREAD, float(settings.spread_weight * np.log(spread))),
            Term(Reason.ANOTHER_PLACE, float(contrast * np.log(rival)), _TYPICAL_RIVAL),
            Term(Reason.LIKE_MANY, float(contrast * np.log(distinct)), _TYPICAL_DISTINCT),
            Term(Reason.SAME_VISIT, -settings.same_visit_penalty * match.same_visit),
            Term(Reason.AT_EDGE, -settings.oldest_penalty * match.oldest),
        )
        if geometry.spread < settings.least_spread:
            # Inliers in few cells are no evidence at all.
            excess = max(sum(term.value for term in terms), 0.0)
            terms = (*terms, Term(Reason.NO_SPREAD, -excess))
        supported = Term(Reason.NO_SUPPORT, settings.support_weight * support, _TYPICAL_SUPPORT)
        close = rival_inliers >= settings.nearly_as_strong * strength
        return Evidence(terms, supported, close and strength < settings.certain_inliers)

    def unverified_evidence(self, match: Match, background_count: int) -> Evidence:
        """
        Return the evidence for a candidate without geometry.

        :param background_count: number of keyframes that were searched. Where they are too few for
            a distribution, the similarity itself counts instead of distinctness.
        """
        distinct = match.distinctness / _FULL_DEVIATIONS
        if background_count < _LEAST_BACKGROUND:
            distinct = match.similarity
        terms = (
            Term(Reason.LIKE_MANY, float(np.log(np.clip(distinct, _LEAST, 1.0)))),
            Term(Reason.UNLIKELY, float(np.log(max(match.similarity, _LEAST)))),
        )
        return Evidence(terms, Term(Reason.NO_SUPPORT, 0.0))

    def score(self, evidence: Evidence) -> float:
        """Return the probability of a verified candidate; at most .5 if it is ambiguous."""
        score = self.verified.score(evidence.total)
        return min(score, 0.5) if evidence.ambiguous else score

    def certainty(self, best: Evidence, rivals: Sequence[Evidence]) -> float:
        """
        Return how much an image supports the next ones: the probability of its best place, alone.

        An image shows one place, so places compete: p = e^b / (e^b + e^c + sum of e^r), with the
        evidence of the best b, of the best match r of each rival place, and the center c of the
        calibration, all times its slope.
        """
        slope, center = self.verified.slope, self.verified.center
        others = np.array([center, *(rival.of_image for rival in rivals)])
        return float(1 / (1 + np.exp(slope * (others - best.of_image)).sum()))
