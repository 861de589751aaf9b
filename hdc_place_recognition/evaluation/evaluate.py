# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs the recognizer on a data set and measures what it says; reads and writes no files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from hdc_place_recognition.datasets.dataset import Dataset, Frames, GroundTruth
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation import metrics
from hdc_place_recognition.evaluation.metrics import (
    Closures,
    count_closures,
    judge,
    Pairs,
    Verdict,
)
from hdc_place_recognition.evaluation.replay import Progress, replay
from hdc_place_recognition.evaluation.run_log import Recording
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
from hdc_place_recognition.results import Candidate
import numpy as np

STAGES = ('read', 'extract', 'encode', 'keypoints', 'query', 'insert', 'verify')


@dataclass(frozen=True)
class Ranking:
    """
    How well the images are ranked, by the functions of the same names in metrics.

    By similarity over all pairs. The last two are about the best match of each query: by score,
    among the candidates it reported, if these were verified; else by similarity.
    """

    average_precision: float | None = None
    average_precision_100: float | None = None
    recall_at_1: float | None = None
    recall_at_5: float | None = None
    recall_at_10: float | None = None
    recall_at_full_precision: float | None = None
    area_best_match: float | None = None


@dataclass(frozen=True)
class Cost:
    """
    What the run took.

    :param ms_per_image: mean milliseconds of each of STAGES over the images that went through it
        (0 if none did), and under 'total' their sum.
    :param images: how many were processed, of both traverses if there are two.
    :param images_passed_over: how many were not, because of their stamps.
    :param features_per_image: mean number of local features.
    :param database_bytes: memory of the database at the end.
    """

    ms_per_image: Mapping[str, float]
    images: int
    images_passed_over: int
    features_per_image: float
    database_bytes: int


@dataclass(frozen=True)
class Judgement:
    """
    What the ground truth says of a run.

    :param pairs: similarities and ground truth of all pairs.
    :param ranking: how well the similarities rank the images.
    :param closures: the accepted candidates, counted.
    :param verdicts: on each candidate, in the order of Evaluation.candidates.
    """

    pairs: Pairs
    ranking: Ranking
    closures: Closures
    verdicts: tuple[Verdict, ...]


@dataclass(frozen=True)
class Evaluation:
    """
    The result of one evaluation.

    :param dataset: what was evaluated.
    :param params: in force at the end.
    :param recording: all that the recognizer said.
    :param cost: what it took.
    :param judgement: None without ground truth.
    """

    dataset: Dataset
    params: Params
    recording: Recording
    cost: Cost
    judgement: Judgement | None

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Return all candidates, accepted or not, in the order of the queries, best first."""
        return tuple(each for said in self.recording.detections for each in said.candidates)

    @property
    def verdicts(self) -> Sequence[Verdict | None]:
        """Return the verdict on each of the candidates; None where there is no ground truth."""
        return self.judgement.verdicts if self.judgement else [None] * len(self.candidates)


def without_progress(frames: Frames, label: str) -> Frames:
    """Return the frames as they are: nobody watches."""
    del label
    return frames


def evaluate(
    dataset: Dataset, recognizer: PlaceRecognizer, progress: Progress = without_progress
) -> Evaluation:
    """
    Run a recognizer on a data set and measure what it says.

    The caller has set the parameters that the data set fixes (`dataset.overrides`).

    :param dataset: images and ground truth.
    :param recognizer: with an empty database; it keeps what it learns.
    :param progress: wraps the images that are gone through, given a label.
    :return: metrics, and the candidates they are about.
    :raises PlaceRecognitionError: an image can not be read, too few images have a pose, or no
        image was processed.
    """
    recording = replay(dataset, recognizer, progress)
    if not recording.detections:
        raise PlaceRecognitionError(f'{dataset.name}: no image was processed; nothing to evaluate')
    return Evaluation(
        dataset=dataset,
        params=recognizer.params,
        recording=recording,
        cost=_cost(recording, recognizer.database.nbytes),
        judgement=_judge(recording, dataset.ground_truth, recognizer.verifies)
        if dataset.ground_truth
        else None,
    )


def rank(pairs: Pairs, scored: Pairs) -> Ranking:
    """
    Return the metrics that do not look at what was accepted.

    :param pairs: with similarities.
    :param scored: with what decides on the best match of each query.
    """
    return Ranking(
        average_precision=metrics.average_precision(pairs),
        average_precision_100=metrics.average_precision_100(pairs),
        recall_at_1=metrics.recall_at_k(pairs, 1),
        recall_at_5=metrics.recall_at_k(pairs, 5),
        recall_at_10=metrics.recall_at_k(pairs, 10),
        recall_at_full_precision=metrics.recall_at_full_precision(scored),
        area_best_match=metrics.area_best_match(scored),
    )


def _judge(recording: Recording, ground_truth: GroundTruth, verified: bool) -> Judgement:
    truth = ground_truth.truth(recording.query_stamps_ns, recording.database_stamps_ns)
    pairs = Pairs(recording.similarity_matrix(), truth.hard, truth.soft, recording.eligible)
    scored = replace(pairs, similarities=recording.score_matrix()) if verified else pairs
    accepted = recording.cells(accepted_only=True)
    return Judgement(
        pairs=pairs,
        ranking=rank(pairs, scored),
        closures=count_closures(accepted, truth.hard, truth.soft, pairs.has_match),
        verdicts=tuple(judge(recording.cells(), truth.hard, truth.soft)),
    )


def _cost(recording: Recording, database_bytes: int) -> Cost:
    means = {}
    for stage in STAGES:
        spent = [each[stage] for each in recording.milliseconds if stage in each]
        means[stage] = float(np.mean(spent)) if spent else 0.0
    return Cost(
        ms_per_image={**means, 'total': sum(means.values())},
        images=len(recording.features),
        images_passed_over=recording.passed_over,
        features_per_image=float(np.mean(recording.features)),
        database_bytes=database_bytes,
    )
