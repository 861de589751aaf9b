# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""From evidence to probability: a table fitted by `hdc_experiments calibrate`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
