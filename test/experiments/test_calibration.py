# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Fitting the score to what was true."""

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.experiments.calibration import fit, LabeledScores, reliability
import numpy as np
import pytest


def test_fit_finds_the_logistic_function_that_made_the_data():
    rng = np.random.default_rng(0)
    evidence = rng.uniform(-3, 5, 20000)
    true = rng.random(20000) < 1 / (1 + np.exp(-2.0 * (evidence - 1.0)))
    fitted = fit([(evidence[:15000], true[:15000]), (evidence[15000:], true[15000:])])
    assert fitted.slope == pytest.approx(2.0, rel=0.05)
    assert fitted.center == pytest.approx(1.0, abs=0.05)


def test_fit_of_separable_data_is_finite():
    fitted = fit([(np.array([-1.0, 0.0, 2.0, 3.0]), np.array([False, False, True, True]))])
    assert 0 < fitted.slope < 10 and 0 < fitted.center < 2


def test_reliability_counts_all_candidates():
    lines = reliability(LabeledScores(np.array([0.01, 0.97, 1.0]), np.array([False, True, True])))
    assert [line.split()[-1] for line in lines[1:]] == ['1', '2']


@pytest.mark.parametrize('truth', [True, False])
def test_candidates_of_one_kind_are_no_calibration(truth):
    with pytest.raises(PlaceRecognitionError, match='3 best candidates are not of both kinds'):
        fit([(np.array([1.0, 2.0, 3.0]), np.full(3, truth))])
