# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs the recognizer on the images of a dataset, in one of three modes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

from hdc_place_recognition.datasets.dataset import Dataset, Frames, Mode, Stamps
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.run_log import NOT_STORED, RunLog
from hdc_place_recognition.recognition.frame_filter import FrameFilter, nanoseconds
from hdc_place_recognition.recognition.recognizer import Observation, PlaceRecognizer
from hdc_place_recognition.results import Detection, Frame, SKIPPED
import numpy as np
from numpy.typing import NDArray

# Wraps frames, given a label, to show a progress bar.
Progress = Callable[[Frames, str], Iterable[Frame]]


def replay(dataset: Dataset, recognizer: PlaceRecognizer, progress: Progress) -> RunLog:
    """
    Run a recognizer on all images of a dataset.

    :param dataset: images, and the mode that determines their order.
    :param recognizer: recognizer with an empty database.
    :param progress: wraps the frames to show a progress bar.
    :return: all detections, with the data that metrics need.
    :raises PlaceRecognitionError: the database is not empty or has a limit, or an image cannot be
        read.
    """
    if len(recognizer.database):
        raise PlaceRecognitionError(
            f'the database already holds {len(recognizer.database)} images; '
            'an evaluation needs an empty one'
        )
    for name in ('max_keyframes', 'max_database_mb'):
        if limit := getattr(recognizer.params, name):
            raise PlaceRecognitionError(
                f'{name} {limit:g}: an evaluation needs all images; set it to 0'
            )
    traverse = recognizer.traverse()
    traverse.camera, traverse.odometry = dataset.camera, dataset.odometry
    if dataset.mode is Mode.SEQUENCE:
        return _replay_sequence(dataset, recognizer, progress)
    if dataset.reference is None:
        return _replay_retrieval(dataset, recognizer, progress)
    return _replay_traverses(dataset, dataset.reference, recognizer, progress)


def _replay_sequence(dataset: Dataset, recognizer: PlaceRecognizer, progress: Progress) -> RunLog:
    """Process each image in order, as the node does."""
    reader = _Reader(progress(dataset.queries, dataset.name))
    detections = []
    for frame, read_ms in reader:
        detection = recognizer.process(frame)
        if detection.status not in SKIPPED:
            timed = {'read': read_ms, **detection.milliseconds}
            detections.append(replace(detection, milliseconds=timed))
    stamps_ns = np.array([detection.stamp_ns for detection in detections], np.int64)
    keyframe_ids = _id_array(detection.keyframe_id for detection in detections)
    return RunLog(
        detections=tuple(detections),
        database_stamps_ns=stamps_ns,
        keyframe_ids=keyframe_ids,
        eligible=_older(detections, stamps_ns, keyframe_ids, recognizer.params.exclude_recent_s),
        features=tuple(detection.n_features for detection in detections),
        milliseconds=tuple(detection.milliseconds for detection in detections),
        skipped=reader.count - len(detections),
    )


def _replay_traverses(
    dataset: Dataset, reference: Frames, recognizer: PlaceRecognizer, progress: Progress
) -> RunLog:
    """Store the reference images, then search for each query."""
    references = _Reader(progress(reference, f'{dataset.name} reference'))
    stored = [_store(recognizer, observed) for observed in _observe(references, recognizer)]
    recognizer.start_traverse()
    queries = _Reader(progress(dataset.queries, dataset.name))
    detections = [_recognize(recognizer, observed) for observed in _observe(queries, recognizer)]
    return RunLog(
        detections=tuple(detections),
        database_stamps_ns=np.array([image.stamp_ns for image in stored], np.int64),
        keyframe_ids=_id_array(image.keyframe_id for image in stored),
        eligible=np.ones((len(detections), len(stored)), np.bool_),
        features=(
            *(image.n_features for image in stored),
            *(detection.n_features for detection in detections),
        ),
        milliseconds=(
            *(image.milliseconds for image in stored),
            *(detection.milliseconds for detection in detections),
        ),
        skipped=references.count + queries.count - len(stored) - len(detections),
    )


def _replay_retrieval(dataset: Dataset, recognizer: PlaceRecognizer, progress: Progress) -> RunLog:
    """Store all images, then search for each image among all others."""
    reader = _Reader(progress(dataset.queries, dataset.name))
    observations = list(_observe(reader, recognizer))
    stored = [_store(recognizer, observed) for observed in observations]
    detections = [
        _recognize(recognizer, observed, image.keyframe_id)
        for observed, image in zip(observations, stored, strict=True)
    ]
    return RunLog(
        detections=tuple(detections),
        database_stamps_ns=np.array([image.stamp_ns for image in stored], np.int64),
        keyframe_ids=_id_array(image.keyframe_id for image in stored),
        eligible=~np.eye(len(stored), dtype=np.bool_),
        features=tuple(image.n_features for image in stored),
        milliseconds=tuple(
            {**image.milliseconds, **detection.milliseconds}
            for image, detection in zip(stored, detections, strict=True)
        ),
        skipped=reader.count - len(stored),
    )


@dataclass
class _Reader:
    """Iterates over frames, counts them, and measures the time to read each one."""

    frames: Iterable[Frame]
    count: int = 0

    def __iter__(self) -> Iterator[tuple[Frame, float]]:
        """Yield each frame with its read time in milliseconds."""
        frames = iter(self.frames)
        while True:
            start = perf_counter()
            frame = next(frames, None)
            if frame is None:
                return
            self.count += 1
            yield frame, _since(start)


@dataclass(frozen=True)
class _Stored:
    """An image that was offered to the database; the id is None if it was not stored."""

    stamp_ns: int
    keyframe_id: int | None
    n_features: int
    milliseconds: Mapping[str, float]


@dataclass(frozen=True)
class _Observed:
    """An observation, and the milliseconds that its image took to be read."""

    observation: Observation
    read_ms: float

    @property
    def milliseconds(self) -> Mapping[str, float]:
        """Return the time of the stages so far."""
        return {'read': self.read_ms, **self.observation.watch.milliseconds}


def _observe(reader: _Reader, recognizer: PlaceRecognizer) -> Iterator[_Observed]:
    """Yield each image that is not skipped because of its stamp."""
    frame_filter = FrameFilter()
    min_interval_ns = nanoseconds(recognizer.params.min_interval_s)
    for frame, read_ms in reader:
        if frame_filter.accept(frame.stamp_ns, min_interval_ns) is None:
            yield _Observed(recognizer.observe(frame), read_ms)


def _store(recognizer: PlaceRecognizer, observed: _Observed) -> _Stored:
    start, observation = perf_counter(), observed.observation
    keyframe_id = recognizer.store(observation).keyframe_id
    timed = {**observed.milliseconds, 'insert': _since(start)}
    return _Stored(observation.query.stamp_ns, keyframe_id, observation.n_features, timed)


def _recognize(
    recognizer: PlaceRecognizer, observed: _Observed, without: int | None = None
) -> Detection:
    detection = recognizer.recognize(observed.observation, without=without)
    return replace(detection, milliseconds={'read': observed.read_ms, **detection.milliseconds})


def _since(start: float) -> float:
    """Return the milliseconds since a value of perf_counter."""
    return (perf_counter() - start) * 1e3


def _id_array(keyframe_ids: Iterable[int | None]) -> NDArray[np.int64]:
    """Return (n,) int64 keyframe ids, NOT_STORED (-1) for None."""
    return np.array([NOT_STORED if id_ is None else id_ for id_ in keyframe_ids], np.int64)


def _older(
    detections: Sequence[Detection],
    stamps_ns: Stamps,
    keyframe_ids: NDArray[np.int64],
    exclude_recent_s: float,
) -> NDArray[np.bool_]:
    """
    Return (n, n) bool, True where the column image is old enough to be a candidate for the row.

    A stored image is old enough if the recognizer compared it. An image that was not stored is
    old enough if it is at least `exclude_recent_s` older.
    """
    exclude_ns = nanoseconds(exclude_recent_s)
    stored = keyframe_ids != NOT_STORED
    eligible = np.zeros((len(detections), len(detections)), np.bool_)
    for index, detection in enumerate(detections):
        compared = keyframe_ids[:index] < len(detection.similarities)
        by_stamp = stamps_ns[index] - stamps_ns[:index] >= exclude_ns
        eligible[index, :index] = np.where(stored[:index], compared, by_stamp)
    return eligible
