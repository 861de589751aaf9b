# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Evidence, score and the fit of the calibration."""

from dataclasses import replace

from hdc_place_recognition.experiments.calibration import fit, LabeledScores, reliability
from hdc_place_recognition.verification.geometry import Geometry
from hdc_place_recognition.verification.scoring import (
    at_edge,
    Calibration,
    Distinctness,
    Evidence,
    UNVERIFIED,
    VERIFIED,
)
import numpy as np
import pytest

GEOMETRY = Geometry(votes=30, inliers=30, spread=8)
EVIDENCE = Evidence(0.4, 0.8, False, 0.5, GEOMETRY)


def score(evidence: Evidence) -> float:
    return VERIFIED.score(evidence.total)


def test_score_is_a_probability_and_its_inverse():
    table = Calibration(slope=2.0, centre=1.0)
    assert table.score(1.0) == 0.5
    assert table.score(1.0 + np.log(3) / 2) == pytest.approx(0.75)
    assert table.evidence(table.score(2.5)) == pytest.approx(2.5)
    assert np.isfinite([table.evidence(0.0), table.evidence(1.0)]).all()


@pytest.mark.parametrize('better', [{'distinctness': 0.9}, {'support': 1.0}])
def test_score_rises_with_what_is_good(better):
    assert score(replace(EVIDENCE, **better)) > score(EVIDENCE)


def test_score_falls_with_what_is_bad():
    for worse in ({'votes': 10}, {'inliers': 10}, {'spread': 5}):
        assert score(replace(EVIDENCE, geometry=replace(GEOMETRY, **worse))) < score(EVIDENCE)
    assert score(replace(EVIDENCE, at_edge=True)) < score(EVIDENCE)


def test_inliers_without_spread_are_no_evidence():
    lumped = Geometry(votes=300, inliers=300, spread=2)
    assert score(replace(EVIDENCE, geometry=lumped)) < 0.5


def test_without_geometry_similarity_decides():
    alone = replace(EVIDENCE, geometry=None)
    assert UNVERIFIED.score(alone.total) > UNVERIFIED.score(replace(alone, similarity=0.2).total)
    assert np.isfinite(replace(alone, similarity=-1.0).total)


def test_distinctness_stands_out_from_the_row():
    noise = np.tile(np.array([0.0, 0.1, 0.2], np.float32), 10)
    row = np.append(noise, np.float32(0.9))
    # Median 0.1, deviation 1.4826 * 0.1 + 0.02.
    assert Distinctness(row).of(float(row[30])) == pytest.approx(0.8 / 0.16826 / 8, rel=1e-4)
    assert Distinctness(row).of(float(row[0])) == 0.05
    assert Distinctness(row[-3:]).of(float(row[-1])) == pytest.approx(0.9)


def test_edges_are_the_first_and_last_two_of_many():
    assert [row for row in range(9) if at_edge(row, 9)] == [0, 1, 7, 8]
    assert not at_edge(0, 7)


def test_fit_finds_the_logistic_function_that_made_the_data():
    rng = np.random.default_rng(0)
    evidence = rng.uniform(-3, 5, 20000)
    true = rng.random(20000) < 1 / (1 + np.exp(-2.0 * (evidence - 1.0)))
    fitted = fit([(evidence[:15000], true[:15000]), (evidence[15000:], true[15000:])])
    assert fitted.slope == pytest.approx(2.0, rel=0.05)
    assert fitted.centre == pytest.approx(1.0, abs=0.05)


def test_fit_of_separable_data_is_finite():
    fitted = fit([(np.array([-1.0, 0.0, 2.0, 3.0]), np.array([False, False, True, True]))])
    assert 0 < fitted.slope < 10 and 0 < fitted.centre < 2


def test_reliability_table_counts_all_candidates():
    lines = reliability(LabeledScores(np.array([0.01, 0.97, 1.0]), np.array([False, True, True])))
    assert [line.split()[-1] for line in lines[1:]] == ['1', '2']
