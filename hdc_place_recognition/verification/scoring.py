# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""From evidence to probability: a table fitted by `hdc_experiments calibrate`."""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.verification.geometry import Geometry
import numpy as np
from numpy.typing import NDArray

_CERTAIN = 1e-12


@dataclass(frozen=True)
class Calibration:
    """
    The logistic function that turns evidence into the probability of a true closure.

    :param slope: positive, so that more evidence never means less probability.
    :param centre: evidence at which true and false are equally likely.
    """

    slope: float
    centre: float

    def score(self, evidence: float) -> float:
        """Return the probability, 0 to 1."""
        return float(1 / (1 + np.exp(-self.slope * (evidence - self.centre))))

    def evidence(self, score: float) -> float:
        """Return the evidence that has a score."""
        inside = np.clip(score, _CERTAIN, 1 - _CERTAIN)
        return float(self.centre + np.log(inside / (1 - inside)) / self.slope)


VERIFIED = Calibration(slope=2.26, centre=0.51)
UNVERIFIED = Calibration(slope=2.17, centre=-2.53)


# A similarity this many robust deviations above the row's median is as distinct as can be.
_DEVIATIONS = 8.0
_LEAST_DEVIATION = 0.02
_MAD_TO_DEVIATION = 1.4826
_ROWS_FOR_DISTRIBUTION = 8
_LEAST = 0.05
# Of the 16 cells; a scene that was recognised fills half of them.
_FULL_SPREAD = 8
# Inliers in fewer cells are one door or one poster, which may hang anywhere.
LEAST_SPREAD = 5
LEAST_INLIERS = 12
LEAST_DISTINCTNESS = 0.5
# At the first and last rows there are no neighbours that could fit better.
_EDGE_ROWS = 2
_EDGE_PENALTY = 1.0
_DISTINCTNESS_WEIGHT = 0.75
_SPREAD_WEIGHT = 1.5
_SUPPORT_BONUS = 0.8


@dataclass(frozen=True)
class Evidence:
    """
    What is known of one candidate.

    :param similarity: centred cosine, -1 to 1.
    :param distinctness: how far it stands out from the row, 0.05 to 1.
    :param at_edge: whether it is one of the first or last rows that were searched.
    :param support: by the images before, 0 to 1.
    :param geometry: None if it was not verified.
    """

    similarity: float
    distinctness: float
    at_edge: bool
    support: float
    geometry: Geometry | None

    @property
    def strength(self) -> float:
        """
        Return the evidence of this image alone: a sum of logarithms that rises with each part.

        Few parts with fixed weights: what was fitted freely leant on similarity, and failed on
        the next set. Inliers without spread are no evidence at all.
        """
        geometry = self.geometry
        if geometry is None:
            return float(np.log(self.distinctness) + np.log(max(self.similarity, _LEAST)))
        agreement = np.log1p(min(geometry.votes, geometry.inliers))
        filled = _SPREAD_WEIGHT * np.log(np.clip(geometry.spread, 1, _FULL_SPREAD) / _FULL_SPREAD)
        edge = _EDGE_PENALTY * self.at_edge
        distinct = _DISTINCTNESS_WEIGHT * np.log(self.distinctness)
        strength = float(agreement + distinct + filled - edge)
        return strength if geometry.spread >= LEAST_SPREAD else min(strength, 0.0)

    @property
    def total(self) -> float:
        """Return the evidence with the support of the images before."""
        return self.strength + _SUPPORT_BONUS * self.support


class Distinctness:
    """
    How far similarities stand out from all those of a query.

    :param similarities: (n,), of the query; where they are too few for a distribution, a value
        itself counts.
    """

    def __init__(self, similarities: NDArray[np.float32]) -> None:
        self._median, self._scale = 0.0, 1.0
        if len(similarities) >= _ROWS_FOR_DISTRIBUTION:
            self._median = float(np.median(similarities))
            away = float(np.median(np.abs(similarities - self._median)))
            self._scale = (_MAD_TO_DEVIATION * away + _LEAST_DEVIATION) * _DEVIATIONS

    def of(self, value: float) -> float:
        """Return that of one similarity, 0.05 to 1."""
        return float(np.clip((value - self._median) / self._scale, _LEAST, 1.0))


def at_edge(row: int, rows: int) -> bool:
    """Return whether a row is one of the first or last of those searched, if they are many."""
    return rows >= _ROWS_FOR_DISTRIBUTION and not _EDGE_ROWS <= row < rows - _EDGE_ROWS
