# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The terms of the evidence, the reason, and the score."""

from __future__ import annotations

from dataclasses import replace

from hdc_place_recognition.database.base import Background
from hdc_place_recognition.results import Reason
from hdc_place_recognition.verification.geometry import Geometry
from hdc_place_recognition.verification.scoring import Evidence, Scorer
from hdc_place_recognition.verification.settings import Calibration, VerificationSettings
import numpy as np
import pytest

SETTINGS = VerificationSettings()
SCORER = Scorer(SETTINGS, Calibration(2.26, 0.51), Calibration(2.17, -2.53))
GEOMETRY = Geometry(votes=30, inliers=30, spread=8)
# A similarity of .18 above the median is fully distinct.
BACKGROUND = Background(100, 0.0, 0.0025 / 1.4826)


def evidence(
    similarity: float = 0.18,
    geometry: Geometry | None = GEOMETRY,
    *,
    background: Background = BACKGROUND,
    at_edge: bool = False,
    support: float = 1.0,
) -> Evidence:
    return SCORER.evidence(similarity, background, geometry, at_edge=at_edge, support=support)


def test_a_probability_and_its_inverse():
    table = Calibration(slope=2.0, center=1.0)
    assert table.score(1.0) == 0.5
    assert table.score(1.0 + np.log(3) / 2) == pytest.approx(0.75)
    assert table.evidence(table.score(2.5)) == pytest.approx(2.5)
    assert np.isfinite([table.evidence(0.0), table.evidence(1.0)]).all()


def test_strength_is_the_sum_of_the_terms():
    found = evidence(0.09, replace(GEOMETRY, votes=20, spread=6), at_edge=True, support=0.5)
    expected = np.log(21) + 0.75 * np.log(0.5) + 1.5 * np.log(6 / 8) - 1
    assert found.strength == pytest.approx(expected, abs=1e-6)
    assert found.total == pytest.approx(expected + 0.4, abs=1e-6)


def test_the_fewer_of_votes_and_inliers_count():
    for fewer in ({'votes': 9}, {'inliers': 9}):
        found = evidence(geometry=replace(GEOMETRY, **fewer))
        assert found.strength == pytest.approx(np.log(10))


@pytest.mark.parametrize(('spread', 'value'), [(4, 0.0), (5, 2.7289), (8, 3.4340), (16, 3.4340)])
def test_spread_below_five_cells_is_no_evidence_at_all(spread, value):
    found = evidence(geometry=replace(GEOMETRY, spread=spread))
    assert found.strength == pytest.approx(value, abs=1e-4)


def test_little_spread_does_not_raise_what_is_negative():
    weak = evidence(0.009, Geometry(votes=1, inliers=1, spread=1))
    assert weak.strength < -4


def test_probability_is_that_of_the_table_with_or_without_geometry():
    verified, alone = evidence(), evidence(geometry=None)
    assert SCORER.probability(verified) == Calibration(2.26, 0.51).score(verified.total)
    assert SCORER.probability(alone) == Calibration(2.17, -2.53).score(alone.total)
    assert SCORER.probability(verified) > 0.99


def test_without_geometry_similarity_decides():
    totals = [evidence(value, None).total for value in (-1.0, 0.05, 0.1, 0.3)]
    assert np.isfinite(totals).all() and totals == sorted(totals)
    assert totals[-1] == pytest.approx(np.log(0.3) + 0.8)


def test_distinctness_is_in_robust_deviations_above_the_median():
    background = Background(100, 0.1, 0.02)
    scale = (1.4826 * 0.02 + 0.02) * 8
    assert SCORER.distinctness(0.3, background) == pytest.approx(0.2 / scale)
    assert SCORER.distinctness(0.1 + 2 * scale, background) == 1
    assert SCORER.distinctness(-0.5, background) == 0.05


def test_a_few_similarities_are_no_distribution():
    assert SCORER.distinctness(0.3, Background(7, 0.25, 0.01)) == pytest.approx(0.3)
    assert SCORER.distinctness(0.3, Background(8, 0.25, 0.01)) < 0.2


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'geometry': replace(GEOMETRY, inliers=4)}, Reason.FEW_INLIERS),
        ({'geometry': replace(GEOMETRY, spread=3)}, Reason.NO_SPREAD),
        ({'similarity': 0.01}, Reason.LIKE_MANY),
        ({'at_edge': True}, Reason.AT_EDGE),
        ({'support': 0.0}, Reason.NO_SUPPORT),
        ({'geometry': None, 'similarity': 0.05}, Reason.UNLIKELY),
        ({'geometry': None, 'background': Background(100, 0.18, 0.1)}, Reason.LIKE_MANY),
    ],
)
def test_the_reason_is_the_term_that_cost_most(changes, reason):
    assert evidence(**changes).reason is reason


def test_few_inliers_are_not_the_reason_where_other_terms_cost_more():
    # Eight inliers can be accepted: here they cost .9, the edge costs 1.
    found = evidence(geometry=replace(GEOMETRY, inliers=10), at_edge=True)
    assert found.reason is Reason.AT_EDGE
    assert evidence(geometry=replace(GEOMETRY, inliers=8), support=0.5).reason is (
        Reason.FEW_INLIERS
    )
