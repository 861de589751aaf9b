# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiment `hdc_experiments calibrate`: fits the score to ground truth."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from hdc_place_recognition.datasets.open_dataset import open_dataset
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.evaluate import evaluate_dataset, Evaluation
from hdc_place_recognition.evaluation.metrics import Label
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import calibrations
from hdc_place_recognition.verification.settings import Calibration
import numpy as np
from numpy.typing import NDArray

# Verified candidates with less evidence are not used for the fit: they have almost no inliers
# (for example images of different seasons).
_LEAST_EVIDENCE = {True: -1.0, False: -np.inf}
_NEWTON_STEPS = 50
# Bounds of the score bins in the reliability table.
_BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0)


@dataclass(frozen=True)
class LabeledScores:
    """
    Scores of the best candidates of a run, without ignored candidates.

    :param scores: (n,) float64, predicted probability.
    :param true: (n,) bool, True for a true closure.
    """

    scores: NDArray[np.float64]
    true: NDArray[np.bool_]


def add_calibrate(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add the subcommand `calibrate`."""
    parser = subparsers.add_parser(
        'calibrate',
        help='fit the calibration of the score',
        description='Fit the score to ground truth on folders with gt.npz. Print the lines for '
        'verification/calibration.json and a reliability table.',
    )
    parser.add_argument('data', nargs='+', type=Path, metavar='DATA_FOLDER')
    parser.set_defaults(run=run_calibrate)


def run_calibrate(arguments: argparse.Namespace) -> str:
    """
    Return lines for verification/calibration.json, and reliability tables.

    :raises PlaceRecognitionError: a folder has no ground truth, or all candidates are true or all
        false.
    """
    lines = []
    for name, verify in (('verified', True), ('unverified', False)):
        runs = [_run(path, verify) for path in arguments.data]
        evidence = [labeled_evidence(*run, verified=verify) for run in runs]
        fitted = fit(evidence)
        lines.append(f'"{name}": {{"slope": {fitted.slope:.2f}, "center": {fitted.center:.2f}}}')
        scores = np.array([fitted.score(value) for values, _ in evidence for value in values])
        true = np.concatenate([labels for _, labels in evidence])
        lines += reliability(LabeledScores(scores, true))
    return '\n'.join(lines)


def best_candidates(evaluation: Evaluation) -> LabeledScores:
    """
    Return the score of the best candidate of each query, without ignored candidates.

    :raises PlaceRecognitionError: the dataset has no ground truth.
    """
    if evaluation.scores is None:
        raise PlaceRecognitionError(
            f'{evaluation.dataset.name}: no ground truth for calibration; use folders with gt.npz'
        )
    labels = iter(evaluation.scores.labels)
    best = []
    for detection in evaluation.run_log.detections:
        labeled = [(candidate.score, next(labels)) for candidate in detection.candidates]
        best += [pair for pair in labeled[:1] if pair[1] is not Label.IGNORED]
    return LabeledScores(
        np.array([score for score, _ in best], np.float64),
        np.array([label is Label.TRUE for _, label in best], np.bool_),
    )


def labeled_evidence(
    labeled: LabeledScores, table: Calibration, *, verified: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """
    Return evidence and labels of the candidates that are used for the fit.

    :param labeled: scores and labels.
    :param table: the calibration of the scores; the evidence is its inverse.
    :param verified: whether the candidates were verified.
    """
    evidence = np.array([table.evidence(score) for score in labeled.scores], np.float64)
    used = evidence >= _LEAST_EVIDENCE[verified]
    return evidence[used], labeled.true[used]


def fit(sets: Sequence[tuple[NDArray[np.float64], NDArray[np.bool_]]]) -> Calibration:
    """
    Fit a logistic function by maximum likelihood.

    The targets are regularized after J. Platt, "Probabilistic outputs for support vector
    machines" (1999): otherwise separable data give an infinite slope.
    The weight of a dataset is the square root of its size, so that large datasets do not dominate.

    :param sets: per dataset the evidence (n,) and the labels (n,) bool, True for a true closure.
    :raises PlaceRecognitionError: the labels are all the same, which leaves the slope open.
    """
    evidence = np.concatenate([values for values, _ in sets])
    true = np.concatenate([truth for _, truth in sets])
    if true.all() or not true.any():
        raise PlaceRecognitionError(
            f'the {len(true)} best candidates are not of both kinds, true and false: the score '
            'cannot be calibrated; give more folders'
        )
    sizes = [len(values) for values, _ in sets]
    weight = np.repeat([max(size, 1) ** -0.5 for size in sizes], sizes)
    weight /= weight.mean()
    positive, negative = float(weight @ true), float(weight @ ~true)
    target = np.where(true, (positive + 1) / (positive + 2), 1 / (negative + 2))
    design = np.stack([evidence, np.ones_like(evidence)], axis=1)
    solution = np.zeros(2)
    for _ in range(_NEWTON_STEPS):
        predicted = 1 / (1 + np.exp(-design @ solution))
        curvature = (design * (weight * predicted * (1 - predicted))[:, None]).T @ design
        solution += np.linalg.solve(curvature, design.T @ (weight * (target - predicted)))
    return Calibration(slope=float(solution[0]), center=float(-solution[1] / solution[0]))


def reliability(labeled: LabeledScores) -> list[str]:
    """Return a text table of predicted scores and observed shares of true closures."""
    lines = ['predicted     mean   observed  candidates']
    for low, high in pairwise(_BINS):
        inside = (labeled.scores >= low) & (labeled.scores < high + (high == 1))
        if inside.any():
            mean, share = labeled.scores[inside].mean(), labeled.true[inside].mean()
            lines.append(f'{low:.2f} to {high:.2f}  {mean:.3f}  {share:.3f}     {inside.sum()}')
    return lines


def _run(path: Path, verify: bool) -> tuple[LabeledScores, Calibration]:
    """Return the best candidates of a data set, and the calibration of their scores."""
    evaluation = evaluate_dataset(open_dataset(path), Params(verify=verify))
    verified, unverified = calibrations(evaluation.identity)
    return best_candidates(evaluation), verified if verify else unverified
