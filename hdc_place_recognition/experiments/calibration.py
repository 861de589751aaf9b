# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiment that fits verification/calibration.json to development data."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from hdc_place_recognition.datasets.open_dataset import open_dataset, Options
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.evaluate import evaluate, Evaluation
from hdc_place_recognition.evaluation.metrics import Verdict
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import calibrations, create_recognizer, use_threads
from hdc_place_recognition.verification.settings import Calibration
import numpy as np
from numpy.typing import NDArray

# Images between which geometry finds nothing, as over seasons, say nothing about its evidence.
_LEAST_EVIDENCE = {True: -1.0, False: -np.inf}
_NEWTON_STEPS = 50
# Bounds of the rows of the table of predicted against observed.
_BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0)


@dataclass(frozen=True)
class Outcomes:
    """
    The best candidates of a run that the truth decides on.

    :param scores: (n,) what was predicted.
    :param true: (n,) bool, whether they are true closures.
    """

    scores: NDArray[np.float64]
    true: NDArray[np.bool_]


def add_calibrate(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add the experiment to the command hdc_experiments."""
    parser = subparsers.add_parser(
        'calibrate',
        help='fit the table of verification/calibration.json',
        description='Fit score to truth on folders with gt.npz, and print the lines that belong '
        'into verification/calibration.json, with what they predict against what is observed.',
    )
    parser.add_argument('data', nargs='+', type=Path, metavar='DATA_FOLDER')
    parser.set_defaults(run=run_calibrate)


def run_calibrate(arguments: argparse.Namespace) -> str:
    """
    Return the fitted table as the lines of verification/calibration.json, and how well it fits.

    :raises PlaceRecognitionError: a folder has no ground truth.
    """
    lines = []
    for name, verify in (('verified', True), ('unverified', False)):
        runs = [_run(path, verify) for path in arguments.data]
        sets = [(best_candidates(evaluation), table) for evaluation, table in runs]
        evidence = [_evidence(found, table, _LEAST_EVIDENCE[verify]) for found, table in sets]
        fitted = fit(evidence)
        lines.append(f'"{name}": {{"slope": {fitted.slope:.2f}, "center": {fitted.center:.2f}}}')
        scores = np.array([fitted.score(value) for each, _ in evidence for value in each])
        true = np.concatenate([each for _, each in evidence])
        lines += reliability(Outcomes(scores, true))
    return '\n'.join(lines)


def best_candidates(evaluation: Evaluation) -> Outcomes:
    """
    Return the best candidate of each query, without those that the truth ignores.

    :raises PlaceRecognitionError: there is no ground truth.
    """
    if evaluation.judgement is None:
        raise PlaceRecognitionError(
            f'{evaluation.dataset.name}: no ground truth to calibrate by; give folders with gt.npz'
        )
    verdicts = iter(evaluation.judgement.verdicts)
    best = []
    for detection in evaluation.recording.detections:
        judged = [(each.score, next(verdicts)) for each in detection.candidates]
        best += [pair for pair in judged[:1] if pair[1] is not Verdict.IGNORED]
    return Outcomes(
        np.array([score for score, _ in best], np.float64),
        np.array([verdict is Verdict.TRUE for _, verdict in best], np.bool_),
    )


def fit(sets: Sequence[tuple[NDArray[np.float64], NDArray[np.bool_]]]) -> Calibration:
    """
    Return the logistic function of greatest likelihood (J. Platt, 1999).

    Targets are drawn in a little, as Platt does: separable evidence would make the slope
    infinite. A set counts by the root of its size, so that none outvotes the others.

    :param sets: of each data set the evidence (n,) and whether it was true (n,).
    """
    evidence = np.concatenate([values for values, _ in sets])
    true = np.concatenate([truth for _, truth in sets])
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


def reliability(outcomes: Outcomes) -> list[str]:
    """Return lines of predicted against observed shares of true closures."""
    lines = ['predicted     mean   observed  candidates']
    for low, high in pairwise(_BINS):
        inside = (outcomes.scores >= low) & (outcomes.scores < high + (high == 1))
        if inside.any():
            mean, share = outcomes.scores[inside].mean(), outcomes.true[inside].mean()
            lines.append(f'{low:.2f} to {high:.2f}  {mean:.3f}  {share:.3f}     {inside.sum()}')
    return lines


def _run(path: Path, verify: bool) -> tuple[Evaluation, Calibration]:
    """Return the run of a data set, and the calibration that its scores were made with."""
    dataset = open_dataset(path, None, Options())
    params = Params(verify=verify).replace(**dataset.overrides)
    use_threads(params)
    recognizer = create_recognizer(params)
    verified, unverified = calibrations(recognizer.identity)
    return evaluate(dataset, recognizer), verified if verify else unverified


def _evidence(
    outcomes: Outcomes, table: Calibration, least: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the evidence that the scores in force were made from, from `least` on."""
    evidence = np.array([table.evidence(score) for score in outcomes.scores], np.float64)
    used = evidence >= least
    return evidence[used], outcomes.true[used]
