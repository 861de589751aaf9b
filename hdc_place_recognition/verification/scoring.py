# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The score of a candidate: named terms of evidence, and the probability of a loop closure."""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.database.base import Background
from hdc_place_recognition.results import Reason
from hdc_place_recognition.verification.geometry import Geometry
from hdc_place_recognition.verification.settings import Calibration, VerificationSettings
import numpy as np

_MAD_TO_DEVIATION = 1.4826


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
    What is known of one candidate, as a sum of terms that are logarithms of likelihood ratios.

    Few terms with fixed weights: a freely fitted form relied on similarity, and failed on the
    next data set.

    :param image: terms of the query image alone.
    :param support: term of the images before it; None if there is no geometry.
    :param geometry: None if the candidate was not verified.
    """

    image: tuple[Term, ...]
    support: Term
    geometry: Geometry | None

    @property
    def strength(self) -> float:
        """Return the evidence of the query image alone."""
        return float(sum(term.value for term in self.image))

    @property
    def total(self) -> float:
        """Return the evidence with the support of the images before."""
        return self.strength + self.support.value

    @property
    def reason(self) -> Reason:
        """Return the reason of the term that cost most."""
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
        self._verified, self._unverified = verified, unverified

    def evidence(
        self,
        similarity: float,
        background: Background,
        geometry: Geometry | None,
        *,
        at_edge: bool,
        support: float,
    ) -> Evidence:
        """
        Return the evidence for a candidate.

        :param similarity: centered cosine, -1 to 1.
        :param background: of the similarities of the query.
        :param geometry: None if it was not verified.
        :param at_edge: whether it is one of the first or last keyframes that were searched.
        :param support: by the images before, 0 to 1.
        """
        supported = Term(
            Reason.NO_SUPPORT,
            self.settings.support_weight * support,
            self.settings.support_weight if geometry else 0.0,
        )
        distinctness = self.distinctness(similarity, background)
        if geometry is None:
            terms = self._without_geometry(similarity, distinctness)
        else:
            terms = self._with_geometry(distinctness, geometry, at_edge)
        return Evidence(terms, supported, geometry)

    def probability(self, evidence: Evidence) -> float:
        """Return the probability of a true loop closure, 0 to 1."""
        table = self._unverified if evidence.geometry is None else self._verified
        return table.score(evidence.total)

    def distinctness(self, similarity: float, background: Background) -> float:
        """
        Return how far a similarity stands out from the others of its query, 0.05 to 1.

        Where these are too few for a distribution, the similarity itself counts.
        """
        settings, median, scale = self.settings, 0.0, 1.0
        if background.count >= settings.background_count:
            median = background.median
            deviation = _MAD_TO_DEVIATION * background.deviation + settings.deviation_floor
            scale = deviation * settings.deviations
        return float(np.clip((similarity - median) / scale, settings.least_distinctness, 1.0))

    def _without_geometry(self, similarity: float, distinctness: float) -> tuple[Term, ...]:
        least = self.settings.least_distinctness
        return (
            Term(Reason.LIKE_MANY, float(np.log(distinctness))),
            Term(Reason.UNLIKELY, float(np.log(max(similarity, least)))),
        )

    def _with_geometry(
        self, distinctness: float, geometry: Geometry, at_edge: bool
    ) -> tuple[Term, ...]:
        settings = self.settings
        agreeing = min(geometry.votes, geometry.inliers)
        filled = np.clip(geometry.spread, 1, settings.full_spread) / settings.full_spread
        terms = (
            Term(
                Reason.FEW_INLIERS,
                float(np.log1p(agreeing)),
                float(np.log1p(settings.typical_inliers)),
            ),
            Term(Reason.LIKE_MANY, float(settings.distinctness_weight * np.log(distinctness))),
            Term(Reason.NO_SPREAD, float(settings.spread_weight * np.log(filled))),
            Term(Reason.AT_EDGE, -settings.edge_penalty * at_edge),
        )
        if geometry.spread >= settings.least_spread:
            return terms
        # Inliers without spread are no evidence at all.
        excess = max(sum(term.value for term in terms), 0.0)
        return (*terms, Term(Reason.NO_SPREAD, -excess))
