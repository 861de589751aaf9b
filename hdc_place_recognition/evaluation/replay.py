# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Shows the images of a data set to the recognizer, in one of three orders."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

from hdc_place_recognition.datasets.dataset import Dataset, Frame, Frames, Mode, Stamps
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.run_log import NOT_STORED, Recording
from hdc_place_recognition.recognition.frame_filter import nanoseconds, StampSelector
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
from hdc_place_recognition.results import Description, Detection, PASSED_OVER
import numpy as np
from numpy.typing import NDArray

Progress = Callable[[Frames, str], Iterable[Frame]]  # wraps images that are gone through, labelled


def replay(dataset: Dataset, recognizer: PlaceRecognizer, progress: Progress) -> Recording:
    """
    Show all images of a data set to a recognizer, in the order that its mode says.

    :param dataset: the images.
    :param recognizer: with an empty database.
    :param progress: wraps the images that are gone through.
    :return: what it said.
    :raises PlaceRecognitionError: the database is not empty or forgets, or an image is bad.
    """
    if len(recognizer.database):
        raise PlaceRecognitionError(
            f'the database already holds {len(recognizer.database)} images; '
            'an evaluation begins with an empty one'
        )
    for name in ('max_keyframes', 'max_database_mb'):
        if limit := getattr(recognizer.params, name):
            raise PlaceRecognitionError(f'{name} {limit:g}: an evaluation needs all; set it to 0')
    recognizer.camera, recognizer.odometry = dataset.camera, dataset.odometry
    if dataset.mode is Mode.SEQUENCE:
        return _replay_sequence(dataset, recognizer, progress)
    if dataset.reference is None:
        return _replay_retrieval(dataset, recognizer, progress)
    return _replay_traverses(dataset, dataset.reference, recognizer, progress)


def _replay_sequence(
    dataset: Dataset, recognizer: PlaceRecognizer, progress: Progress
) -> Recording:
    """Process each image in order, as the node does."""
    reader = _Reader(progress(dataset.queries, dataset.name))
    detections = []
    for stamp_ns, image, read_ms in reader:
        detection = recognizer.process(stamp_ns, image)
        if detection.status not in PASSED_OVER:
            timed = {'read': read_ms, **detection.milliseconds}
            detections.append(replace(detection, milliseconds=timed))
    stamps_ns = np.array([detection.stamp_ns for detection in detections], np.int64)
    rows = _rows(detection.keyframe_id for detection in detections)
    return Recording(
        detections=tuple(detections),
        database_stamps_ns=stamps_ns,
        rows=rows,
        eligible=_older(detections, stamps_ns, rows, recognizer.params.exclude_recent_s),
        features=tuple(detection.n_features for detection in detections),
        milliseconds=tuple(detection.milliseconds for detection in detections),
        passed_over=reader.count - len(detections),
    )


def _replay_traverses(
    dataset: Dataset, reference: Frames, recognizer: PlaceRecognizer, progress: Progress
) -> Recording:
    """Learn the reference, then only ask for each query."""
    references = _Reader(progress(reference, f'{dataset.name} reference'))
    learned = [_learn(recognizer, each) for each in _describe(references, recognizer)]
    recognizer.start_sequence()
    queries = _Reader(progress(dataset.queries, dataset.name))
    detections = [recognizer.recognize(each) for each in _describe(queries, recognizer)]
    return Recording(
        detections=tuple(detections),
        database_stamps_ns=np.array([each.stamp_ns for each in learned], np.int64),
        rows=_rows(each.keyframe_id for each in learned),
        eligible=np.ones((len(detections), len(learned)), np.bool_),
        features=(
            *(each.n_features for each in learned),
            *(each.n_features for each in detections),
        ),
        milliseconds=(
            *(each.milliseconds for each in learned),
            *(each.milliseconds for each in detections),
        ),
        passed_over=references.count + queries.count - len(learned) - len(detections),
    )


def _replay_retrieval(
    dataset: Dataset, recognizer: PlaceRecognizer, progress: Progress
) -> Recording:
    """Learn all images, then ask for each among the others."""
    reader = _Reader(progress(dataset.queries, dataset.name))
    descriptions = list(_describe(reader, recognizer))
    learned = [_learn(recognizer, each) for each in descriptions]
    detections = [
        recognizer.recognize(description, skip_id=itself.keyframe_id)
        for description, itself in zip(descriptions, learned, strict=True)
    ]
    return Recording(
        detections=tuple(detections),
        database_stamps_ns=np.array([each.stamp_ns for each in learned], np.int64),
        rows=_rows(each.keyframe_id for each in learned),
        eligible=~np.eye(len(learned), dtype=np.bool_),
        features=tuple(each.n_features for each in learned),
        milliseconds=tuple(
            {**itself.milliseconds, **detection.milliseconds}
            for itself, detection in zip(learned, detections, strict=True)
        ),
        passed_over=reader.count - len(learned),
    )


@dataclass
class _Reader:
    """Goes through frames, counting them and timing how long each took to be read."""

    frames: Iterable[Frame]
    count: int = 0

    def __iter__(self) -> Iterator[tuple[int, NDArray[np.uint8], float]]:
        """Yield stamp, image and milliseconds."""
        frames = iter(self.frames)
        while True:
            start = perf_counter()
            frame = next(frames, None)
            if frame is None:
                return
            self.count += 1
            yield *frame, _since(start)


@dataclass(frozen=True)
class _Learned:
    """An image that was shown in order to be stored."""

    stamp_ns: int
    keyframe_id: int | None
    n_features: int
    milliseconds: Mapping[str, float]


def _describe(reader: _Reader, recognizer: PlaceRecognizer) -> Iterator[Description]:
    """Yield the description of each image that is not too near to the one before."""
    selector = StampSelector()
    min_interval_ns = nanoseconds(recognizer.params.min_interval_s)
    for stamp_ns, image, read_ms in reader:
        if selector.admit(stamp_ns, min_interval_ns) is None:
            description = recognizer.describe(stamp_ns, image)
            timed = {'read': read_ms, **description.milliseconds}
            yield replace(description, milliseconds=timed)


def _learn(recognizer: PlaceRecognizer, description: Description) -> _Learned:
    start = perf_counter()
    row = recognizer.learn(description)
    timed = {**description.milliseconds, 'insert': _since(start)}
    return _Learned(description.stamp_ns, row, description.n_features, timed)


def _since(start: float) -> float:
    return (perf_counter() - start) * 1e3


def _rows(keyframe_ids: Iterable[int | None]) -> NDArray[np.int64]:
    return np.array([NOT_STORED if row is None else row for row in keyframe_ids], np.int64)


def _older(
    detections: Sequence[Detection],
    stamps_ns: Stamps,
    rows: NDArray[np.int64],
    exclude_recent_s: float,
) -> NDArray[np.bool_]:
    """
    Return (n, n) bool, the images of a sequence that were old enough for each to be compared with.

    Of the stored ones the recognizer tells how many it compared; the others go by their stamps.
    """
    exclude_ns = nanoseconds(exclude_recent_s)
    stored = rows != NOT_STORED
    eligible = np.zeros((len(detections), len(detections)), np.bool_)
    for index, detection in enumerate(detections):
        compared = rows[:index] < len(detection.similarities)
        by_stamp = stamps_ns[index] - stamps_ns[:index] >= exclude_ns
        eligible[index, :index] = np.where(stored[:index], compared, by_stamp)
    return eligible
