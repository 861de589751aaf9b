# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs the recognizer on a dataset and computes metrics; writes no files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
import logging
from pathlib import Path
from typing import Any

from hdc_place_recognition.datasets.dataset import Dataset, Frames, GroundTruth
from hdc_place_recognition.datasets.open_dataset import open_dataset, Options
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.metrics import (
    area_best_match,
    average_precision,
    average_precision_100,
    Closures,
    count_closures,
    Label,
    label_matches,
    Pairs,
    recall_at_full_precision,
    recall_at_k,
)
from hdc_place_recognition.evaluation.replay import Progress, replay
from hdc_place_recognition.evaluation.run_log import RunLog
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import create_recognizer, limited_threads
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
from hdc_place_recognition.results import Candidate
import numpy as np

_log = logging.getLogger(__name__)

STAGES = ('read', 'extract', 'encode', 'keypoints', 'query', 'insert', 'verify')
_CLOSURE_METRICS = (
    'closures_true',
    'closures_false',
    'closures_ignored',
    'queries_with_match',
    'precision',
    'recall',
)


@dataclass(frozen=True)
class Ranking:
    """
    How well images are ranked: the metrics of the same names in evaluation/metrics.py.

    The first five metrics rank all pairs by similarity. The last two use the best match of each
    query: the candidate of highest score if candidates are verified, otherwise the image of
    highest similarity.
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
    Time and memory of a run.

    :param ms_per_image: mean milliseconds of each stage of STAGES, over the images that went
        through the stage (0 if there are none); 'total' is their sum.
    :param images: number of processed images, of both traverses if there are two.
    :param images_passed_over: number of images that were skipped because of their stamps.
    :param features_per_image: mean number of local features.
    :param database_bytes: memory of the database at the end of the run.
    """

    ms_per_image: Mapping[str, float]
    images: int
    images_passed_over: int
    features_per_image: float
    database_bytes: int


@dataclass(frozen=True)
class Scores:
    """
    The result of comparing a run with ground truth.

    :param pairs: similarities and ground truth of all pairs.
    :param ranking: how well images are ranked.
    :param closures: counts of the accepted candidates.
    :param labels: label of each candidate, in the order of Evaluation.candidates.
    """

    pairs: Pairs
    ranking: Ranking
    closures: Closures
    labels: tuple[Label, ...]


@dataclass(frozen=True)
class Evaluation:
    """
    The result of one evaluation.

    :param dataset: the evaluated dataset.
    :param params: parameters at the end of the run.
    :param run_log: all detections.
    :param identity: of the local features.
    :param cost: time and memory.
    :param scores: comparison with ground truth, None without ground truth.
    """

    dataset: Dataset
    params: Params
    run_log: RunLog
    identity: str
    cost: Cost
    scores: Scores | None

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Return all candidates, accepted or not, in the order of the queries, best first."""
        return tuple(
            candidate
            for detection in self.run_log.detections
            for candidate in detection.candidates
        )

    @property
    def labels(self) -> Sequence[Label | None]:
        """Return the label of each candidate; None without ground truth."""
        return self.scores.labels if self.scores else [None] * len(self.candidates)

    @property
    def metrics(self) -> dict[str, Any]:
        """
        Return the content of metrics.json.

        A value is None without ground truth, or if the metric is not defined. `closures` counts
        accepted candidates without regard to ground truth.
        """
        return {
            'name': self.dataset.name,
            **asdict(self.scores.ranking if self.scores else Ranking()),
            'closures': sum(candidate.accepted for candidate in self.candidates),
            **_closure_metrics(self.scores),
            **asdict(self.cost),
        }


def without_progress(frames: Frames, label: str) -> Frames:
    """Return the frames unchanged: no progress bar."""
    del label
    return frames


def evaluate_input(
    path: str | Path,
    *,
    database: str | Path | None = None,
    topic: str | None = None,
    ground_truth_topic: str | None = None,
    ground_truth_frames: str | None = None,
    radius_m: float = Options.radius_m,
    max_angle_deg: float = Options.max_angle_deg,
    view_axis: str | None = None,
    camera_info_topic: str | None = None,
    odom_topic: str | None = None,
    odom_frames: str | None = None,
    skip_bad: bool = False,
    exif_orientation: bool = True,
    progress: Progress = without_progress,
    **params: Any,
) -> Evaluation:
    """
    Evaluate a bag or an image folder, like the command hdc_evaluate.

    The options are those of :class:`Options`; all other keywords are parameters by name.

    :param path: a bag, or a folder with images/ (or images/ref and images/query).
    :param database: earlier traverse that `path` is compared with; None finds loops in `path`.
    :raises PlaceRecognitionError: an input, an option or a parameter is invalid.
    """
    settings = Params.from_dict(params)
    options = Options(
        topic=topic,
        ground_truth_topic=ground_truth_topic,
        ground_truth_frames=ground_truth_frames,
        radius_m=radius_m,
        max_angle_deg=max_angle_deg,
        view_axis=view_axis,
        pose_tolerance_s=settings.odom_tolerance_s,
        camera_info_topic=camera_info_topic,
        odom_topic=odom_topic,
        odom_frames=odom_frames,
        image_rectified=settings.image_rectified,
        skip_bad=skip_bad,
        exif_orientation=exif_orientation,
        max_image_pixels=settings.max_image_pixels,
    )
    dataset = open_dataset(Path(path), None if database is None else Path(database), options)
    return evaluate_dataset(dataset, settings, progress)


def evaluate_dataset(
    dataset: Dataset, params: Params, progress: Progress = without_progress
) -> Evaluation:
    """
    Evaluate a new recognizer with the parameters and the overrides of the dataset.

    The threads of BLAS and OpenCV are those of the parameters until it returns.

    :raises PlaceRecognitionError: see :func:`evaluate` and :func:`create_recognizer`.
    """
    params = params.replace(**dataset.overrides)
    with limited_threads(params):
        recognizer = create_recognizer(params)
        _log.info('%s: local features are %s', dataset.name, recognizer.identity)
        return evaluate(dataset, recognizer, progress)


def evaluate(
    dataset: Dataset, recognizer: PlaceRecognizer, progress: Progress = without_progress
) -> Evaluation:
    """
    Run a recognizer on a dataset and compute the metrics.

    The caller applies `dataset.overrides` to the parameters of the recognizer.

    :param dataset: images and ground truth.
    :param recognizer: recognizer with an empty database; the images are added to it.
    :param progress: wraps the frames to show a progress bar.
    :return: detections and metrics.
    :raises PlaceRecognitionError: an image cannot be read, too few images have a pose, or no
        image was processed.
    """
    run_log = replay(dataset, recognizer, progress)
    if not run_log.detections:
        raise PlaceRecognitionError(f'{dataset.name}: no image was processed; nothing to evaluate')
    truth = dataset.ground_truth
    return Evaluation(
        dataset=dataset,
        params=recognizer.params,
        run_log=run_log,
        identity=recognizer.identity,
        cost=_cost(run_log, recognizer.database.nbytes),
        scores=_scores(run_log, truth, recognizer.verifies) if truth else None,
    )


def rank(pairs: Pairs, best_match_pairs: Pairs) -> Ranking:
    """
    Return the metrics that do not depend on which candidates are accepted.

    :param pairs: pairs with similarities, for the metrics over all pairs.
    :param best_match_pairs: pairs with the values that select the best match of each query.
    """
    return Ranking(
        average_precision=average_precision(pairs),
        average_precision_100=average_precision_100(pairs),
        recall_at_1=recall_at_k(pairs, 1),
        recall_at_5=recall_at_k(pairs, 5),
        recall_at_10=recall_at_k(pairs, 10),
        recall_at_full_precision=recall_at_full_precision(best_match_pairs),
        area_best_match=area_best_match(best_match_pairs),
    )


def _scores(run_log: RunLog, ground_truth: GroundTruth, verified: bool) -> Scores:
    """Compare a run with ground truth."""
    truth = ground_truth.truth(run_log.query_stamps_ns, run_log.database_stamps_ns)
    pairs = Pairs(run_log.similarity_matrix(), truth.hard, truth.soft, run_log.eligible)
    by_score = replace(pairs, similarities=run_log.score_matrix()) if verified else pairs
    accepted = run_log.cells(accepted_only=True)
    return Scores(
        pairs=pairs,
        ranking=rank(pairs, by_score),
        closures=count_closures(accepted, truth.hard, truth.soft, pairs.has_match),
        labels=tuple(label_matches(run_log.cells(), truth.hard, truth.soft)),
    )


def _cost(run_log: RunLog, database_bytes: int) -> Cost:
    """Return time and memory of a run."""
    means = {}
    for stage in STAGES:
        times = [times[stage] for times in run_log.milliseconds if stage in times]
        means[stage] = float(np.mean(times)) if times else 0.0
    return Cost(
        ms_per_image={**means, 'total': sum(means.values())},
        images=len(run_log.features),
        images_passed_over=run_log.skipped,
        features_per_image=float(np.mean(run_log.features)),
        database_bytes=database_bytes,
    )


def _closure_metrics(scores: Scores | None) -> dict[str, float | None]:
    """Return the metrics of the accepted candidates, all None without ground truth."""
    if scores is None:
        return dict.fromkeys(_CLOSURE_METRICS)
    found = scores.closures
    counts = (found.true, found.false, found.ignored, found.queries_with_match)
    return dict(zip(_CLOSURE_METRICS, (*counts, found.precision, found.recall), strict=True))
