# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The cost of an image: extraction, and all stages from image to candidates."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
import logging
from time import perf_counter

import cv2
from hdc_place_recognition.benchmark.settings import Settings
from hdc_place_recognition.benchmark.timing import (
    Measurement,
    milliseconds,
)
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.registry import create_extractor, EXTRACTORS
from hdc_place_recognition.recognition.factory import create_recognizer
from hdc_place_recognition.results import Frame
import numpy as np
from numpy.typing import NDArray

_log = logging.getLogger(__name__)
_STEP = 24  # pixels from one image to the next
_NS = 10**9
_BLOBS = (64, 32, 8)  # sizes of the blobs: width / this


def street(images: int, width: int = 640, height: int = 480) -> list[NDArray[np.uint8]]:
    """
    Return the images of a traverse along a wall of blobs of several sizes.

    At the width at which keypoints are extracted, real images have 400 to 900 keypoints before the
    strongest are selected. These images have as many.
    """
    rng = np.random.default_rng(0)
    wall = np.zeros((height, width + _STEP * images, 3), np.float32)
    for scale in (width // share for share in _BLOBS):
        small = rng.random((height // scale, wall.shape[1] // scale, 3), np.float32)
        wall += cv2.resize(small, wall.shape[1::-1], interpolation=cv2.INTER_CUBIC)
    stretched = np.clip(wall * 85, 0, 255).astype(np.uint8)
    return [
        np.ascontiguousarray(stretched[:, slice(left, left + width)])
        for left in range(0, _STEP * images, _STEP)
    ]


def measure_extraction(settings: Settings) -> Iterator[Measurement]:
    """Yield the cost of each extractor; log and skip an extractor that cannot run."""
    (image,), params = street(1), settings.params
    for name in EXTRACTORS:
        try:
            extractor = create_extractor(
                name,
                image_width=params.image_width,
                max_features=params.max_features,
                threads=params.threads,
            )
            spent = milliseconds(partial(extractor.extract, image))
        except PlaceRecognitionError as error:
            _log.warning('%s skipped: %s', name, error)
        else:
            yield Measurement(f'extraction, {name}, 640 x 480', spent, 'ms')


def measure_pipeline(settings: Settings) -> Iterator[Measurement]:
    """
    Yield the cost of all stages of processing, over a traverse that is driven twice.

    :raises PlaceRecognitionError: the extractor cannot run.
    """
    recognizer, images = create_recognizer(settings.params), street(settings.images)
    detections, spent = [], []
    for number, image in enumerate((*images, *images)):
        start = perf_counter()
        detections.append(recognizer.process(Frame(number * _NS, image)))
        spent.append((perf_counter() - start) * 1e3)
    stages = {
        stage: float(np.median([detection.milliseconds[stage] for detection in detections]))
        for stage in detections[-1].milliseconds
    }
    for stage, median in stages.items():
        yield Measurement(f'image, {stage}', median, 'ms', median / stages['extract'], 'extract')
    own = stages['encode'] + stages['query'] + stages['insert']
    name = 'image, encode + query + insert'
    yield Measurement(name, own, 'ms', own / stages['extract'], 'extract')
    features = stages['extract'] + stages.get('keypoints', 0.0)
    yield Measurement(name, own, 'ms', own / features, 'extract + keypoints', '<= 0.4')
    yield Measurement('image, total, median', float(np.median(spent)), 'ms')
    yield Measurement('image, total, 99 %', float(np.percentile(spent, 99)), 'ms')
    database = recognizer.database
    kilobytes = database.nbytes / len(database) / 1e3
    yield Measurement('memory of a keyframe, with keypoints', kilobytes, 'kB')
