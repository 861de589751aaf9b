# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The terms of the evidence, the reason, the score, and certainty, on evidence made by hand."""

from __future__ import annotations

from dataclasses import replace

from hdc_place_recognition.database.base import Match
from hdc_place_recognition.results import Reason
from hdc_place_recognition.verification.geometry import Geometry
from hdc_place_recognition.verification.scoring import Evidence, Scorer, Term
from hdc_place_recognition.verification.settings import Calibration, VerificationSettings
import numpy as np
import pytest

SETTINGS = VerificationSettings()
SCORER = Scorer(SETTINGS, Calibration(2.0, 1.5), Calibration(2.17, -2.53))
MATCH = Match(7, similarity=0.3, shift=0, distinctness=6.0)
GEOMETRY = Geometry(inliers=30, guided=0, spread=9)


def evidence(
    match: Match = MATCH,
    geometry: Geometry = GEOMETRY,
    *,
    rival_inliers: float = 0.0,
    rival_distinctness: float = 2.0,
    support: float = 0.0,
) -> Evidence:
    return SCORER.evidence(
        match,
        geometry,
        rival_inliers=rival_inliers,
        rival_distinctness=rival_distinctness,
        support=support,
    )


def values(found: Evidence, reason: Reason) -> list[float]:
    """Return the values of the terms with a reason."""
    return [term.value for term in (*found.image, found.support) if term.reason is reason]


def seen(inliers: int, spread: int = 9) -> Geometry:
    return Geometry(inliers=inliers, spread=spread)


def test_a_probability_and_its_inverse():
    table = Calibration(slope=2.0, center=1.0)
    assert table.score(1.0) == 0.5
    assert table.score(1.0 + np.log(3) / 2) == pytest.approx(0.75)
    assert table.evidence(table.score(2.5)) == pytest.approx(2.5)
    assert np.isfinite([table.evidence(0.0), table.evidence(1.0)]).all()


def test_the_evidence_is_the_sum_of_the_terms():
    found = evidence(
        replace(MATCH, oldest=True, same_visit=True),
        replace(GEOMETRY, guided=120, spread=6),
        rival_inliers=14,
        support=0.5,
    )
    expected = np.log(61) + 1.5 * np.log(6 / 8) + 0.5 * np.log(61 / 15) + 0.5 * np.log(7 / 3) - 4
    assert found.of_image == pytest.approx(expected, abs=1e-6)
    assert found.total == pytest.approx(expected + 0.4, abs=1e-6)


@pytest.mark.parametrize(
    ('reason', 'value'),
    [
        (Reason.FEW_INLIERS, np.log(31)),
        (Reason.NO_SPREAD, 0.0),
        (Reason.ANOTHER_PLACE, 0.5 * np.log(31 / 8)),
        (Reason.LIKE_MANY, 0.5 * np.log(7 / 3)),
        (Reason.SAME_VISIT, 0.0),
        (Reason.AT_EDGE, 0.0),
        (Reason.NO_SUPPORT, 0.0),
    ],
)
def test_each_term_asks_for_something_of_its_own(reason, value):
    assert values(evidence(), reason) == [pytest.approx(value)]


@pytest.mark.parametrize(('spread', 'value'), [(5, 5 / 8), (7, 7 / 8), (8, 1), (16, 1)])
def test_spread_counts_up_to_eight_cells(spread, value):
    (found,) = values(evidence(geometry=seen(30, spread)), Reason.NO_SPREAD)
    assert found == pytest.approx(1.5 * np.log(value))


@pytest.mark.parametrize('spread', [0, 1, 4])
def test_inliers_in_fewer_than_five_cells_are_no_evidence_at_all(spread):
    found = evidence(geometry=seen(200, spread))
    assert found.of_image == pytest.approx(0 if spread else min(found.of_image, 0))
    assert SCORER.score(found) < 0.06 and found.reason is Reason.NO_SPREAD
    # Support by the images before is not lost.
    assert evidence(geometry=seen(200, 4), support=1.0).total == pytest.approx(0.8)


def test_few_cells_do_not_raise_what_is_negative():
    match = replace(MATCH, distinctness=0.0, same_visit=True)
    weak = evidence(match, seen(1, 1), rival_inliers=30, rival_distinctness=20)
    expected = np.log(2) + 1.5 * np.log(1 / 8) + 0.5 * np.log(2 / 31) - 0.5 * np.log(21) - 3
    assert weak.of_image == pytest.approx(expected)


def test_a_rival_below_chance_does_not_count():
    assert evidence().total == evidence(rival_inliers=7.0).total
    assert evidence(rival_inliers=8.0).total < evidence().total


def test_more_of_each_evidence_raises_the_score():
    base = {
        'match': replace(MATCH, distinctness=4.0),
        'geometry': seen(12, 6),
        'rival_inliers': 9.0,
        'rival_distinctness': 3.0,
        'support': 0.3,
    }
    better = {
        'match': replace(MATCH, distinctness=9.0),
        'geometry': seen(20, 6),
        'rival_inliers': 8.0,
        'rival_distinctness': 1.0,
        'support': 1.0,
    }
    for name, value in better.items():
        assert evidence(**{**base, name: value}).total > evidence(**base).total
    assert evidence(**{**base, 'geometry': seen(12, 8)}).total > evidence(**base).total


def test_a_rival_nearly_as_strong_makes_a_place_ambiguous():
    close, clear = (evidence(rival_inliers=strength) for strength in (21.0, 20.9))
    assert close.ambiguous and close.reason is Reason.ANOTHER_PLACE and not clear.ambiguous
    assert SCORER.score(close) <= 0.5 < SCORER.score(clear)
    weak = evidence(geometry=seen(3, 5), rival_inliers=3.0)
    assert weak.ambiguous and SCORER.score(weak) == SCORER.verified.score(weak.total) < 0.5


def test_beyond_doubt_a_rival_may_be_another_visit():
    assert evidence(geometry=seen(39), rival_inliers=39.0).ambiguous
    assert not evidence(geometry=seen(40), rival_inliers=40.0).ambiguous


def test_the_score_is_the_probability_of_the_table():
    found = evidence(support=1.0)
    assert SCORER.score(found) == Calibration(2.0, 1.5).score(found.total) > 0.99


def test_the_same_visit_and_the_oldest_cost():
    total = evidence().total
    assert evidence(replace(MATCH, same_visit=True)).total == pytest.approx(total - 3)
    assert evidence(replace(MATCH, oldest=True)).total == pytest.approx(total - 1)


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'geometry': seen(2)}, Reason.FEW_INLIERS),
        ({'geometry': seen(30, 1)}, Reason.NO_SPREAD),
        ({'geometry': seen(45), 'rival_inliers': 45.0}, Reason.ANOTHER_PLACE),
        ({'match': replace(MATCH, distinctness=0), 'rival_distinctness': 9.0}, Reason.LIKE_MANY),
        ({'match': replace(MATCH, same_visit=True)}, Reason.SAME_VISIT),
        ({'match': replace(MATCH, oldest=True)}, Reason.AT_EDGE),
        ({'geometry': seen(200), 'support': 0.0}, Reason.NO_SUPPORT),
    ],
)
def test_the_reason_is_the_term_that_cost_most(changes, reason):
    assert evidence(**{'geometry': seen(50), 'support': 1.0, **changes}).reason is reason


def test_the_cost_of_a_term_is_what_is_missing_against_a_typical_closure():
    assert Term(Reason.FEW_INLIERS, 3.0, 4.1).cost == pytest.approx(1.1)
    assert Term(Reason.AT_EDGE, -1.0).cost == 1.0


# Without geometry


def alone(similarity: float, distinctness: float = 8.0, count: int = 100) -> Evidence:
    match = replace(MATCH, similarity=similarity, distinctness=distinctness)
    return SCORER.unverified_evidence(match, count)


def test_without_geometry_similarity_and_distinctness_decide():
    assert alone(0.3, 4.0).total == pytest.approx(np.log(0.3) + np.log(0.5))
    assert alone(0.3, 80.0).total == pytest.approx(np.log(0.3))
    totals = [alone(similarity).total for similarity in (-1.0, 0.05, 0.1, 0.3)]
    assert np.isfinite(totals).all() and totals == sorted(totals)
    assert alone(0.3, 0.0).total == pytest.approx(np.log(0.3) + np.log(0.05))


def test_a_few_similarities_are_no_distribution():
    assert alone(0.3, 0.0, count=7).total == pytest.approx(2 * np.log(0.3))
    assert alone(0.3, 0.0, count=8).total < alone(0.3, 0.0, count=7).total


def test_the_reason_without_geometry():
    assert alone(0.05).reason is Reason.UNLIKELY
    assert alone(0.9, 0.5).reason is Reason.LIKE_MANY


# Certainty: places compete


def test_certainty_of_a_place_without_rival_is_its_score_alone():
    found = evidence(support=1.0)
    alone_of_image = Calibration(2.0, 1.5).score(found.of_image)
    assert SCORER.certainty(found, []) == pytest.approx(alone_of_image)


def test_places_share_certainty():
    strong, weak = evidence(geometry=seen(100)), evidence(geometry=seen(9))
    assert SCORER.certainty(strong, []) > 0.99
    assert SCORER.certainty(strong, [strong]) == pytest.approx(0.5, abs=0.01)
    assert SCORER.certainty(strong, [strong, strong]) == pytest.approx(1 / 3, abs=0.01)
    assert SCORER.certainty(strong, [weak]) > 0.98
    assert SCORER.certainty(weak, [strong]) < 0.02


def test_certainty_is_a_softmax_of_the_evidence_times_the_slope():
    best, rival = evidence(geometry=seen(20)), evidence(geometry=seen(14))
    b, r = (np.exp(2.0 * found.of_image) for found in (best, rival))
    assert SCORER.certainty(best, [rival]) == pytest.approx(b / (b + r + np.exp(3.0)))
