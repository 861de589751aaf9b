# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The places that an image may be of, held against each other."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from hdc_place_recognition.core import calibration
from hdc_place_recognition.core.evidence import Evidence

# A neighbour of the best row is as good if its geometry is nearly as strong.
_AS_GOOD = 0.7
# Rows further than this from the best may be another place, and rivals if they are nearly as
# strong: such an image is of a place with look-alikes, and supports the next ones less.
_ELSEWHERE_ROWS = 10
_CLEAR_LEAD = 0.7


@dataclass(frozen=True)
class Hypothesis:
    """
    A row that an image may be the place of.

    :param evidence: what is known of it.
    :param score: the probability that it is a true closure; 0 where it was not asked for.
    :param elsewhere: whether the score is low because another place is better.
    """

    row: int
    evidence: Evidence
    score: float = 0.0
    elsewhere: bool = False


def best_of(looked: Iterable[Hypothesis]) -> Hypothesis:
    """Return the row with most evidence."""
    return max(looked, key=lambda each: each.evidence.total)


def certainty(looked: Iterable[Hypothesis], best: Hypothesis) -> float:
    """Return the strength of the best row, less what its lead over a rival elsewhere lacks."""
    strength = best.evidence.strength
    leads = [
        strength - each.evidence.strength
        for each in looked
        if abs(each.row - best.row) > _ELSEWHERE_ROWS
    ]
    return strength - max(_CLEAR_LEAD - min(leads, default=_CLEAR_LEAD), 0.0)


def rank(looked: Iterable[Hypothesis], best: Hypothesis) -> list[Hypothesis]:
    """
    Return rows with their scores, best first.

    An image shows one place: another one can be true only as far as the best is not. A strong
    second place is the same scene from elsewhere, and a closure there would bend the map.
    """
    most = _probability(best.evidence)
    scored = []
    for each in looked:
        own = _probability(each.evidence)
        elsewhere = not _same_place(each, best)
        score = min(own, 1 - most) if elsewhere else own
        scored.append(Hypothesis(each.row, each.evidence, score, elsewhere and score < own))
    return sorted(scored, key=lambda each: (-each.score, -each.evidence.similarity))


def _probability(evidence: Evidence) -> float:
    verified = evidence.geometry is not None
    table = calibration.VERIFIED if verified else calibration.UNVERIFIED
    return table.score(evidence.total)


def _same_place(looked: Hypothesis, best: Hypothesis) -> bool:
    """Return whether a row is the best one, or next to it and nearly as good."""
    if looked.row == best.row:
        return True
    geometry, strongest = looked.evidence.geometry, best.evidence.geometry
    if geometry is None or strongest is None or abs(looked.row - best.row) > 1:
        return False
    return geometry.strength >= _AS_GOOD * strongest.strength
