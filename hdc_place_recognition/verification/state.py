# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What verification remembers from one image of a traverse to the next."""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.verification.path import Background, PathFilter
from hdc_place_recognition.verification.settings import VerificationSettings
from hdc_place_recognition.verification.temporal import TemporalSupport
import numpy as np


@dataclass
class VerificationState:
    """
    The state of one traverse.

    :param temporal: matches of the last images.
    :param path: paths along the keyframes of other traverses.
    :param background: similarity of the dense cells of different places.
    :param random: draws keyframes for the background.
    """

    temporal: TemporalSupport
    path: PathFilter
    background: Background
    random: np.random.Generator

    @classmethod
    def new(cls, settings: VerificationSettings, number: int) -> VerificationState:
        """Return the state before the first image of a traverse of this number."""
        random = np.random.default_rng(number)
        return cls(TemporalSupport(settings), PathFilter(), Background(), random)
