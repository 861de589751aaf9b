# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Taking the landmarks of an image, beside whatever else is done with it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

from hdc_place_recognition.features.compact import keep, Landmarks
from hdc_place_recognition.features.local_features import Extractor
from hdc_place_recognition.hdc.algebra import Hypervector
from hdc_place_recognition.hdc.image_descriptor import DescriptorEncoder
from hdc_place_recognition.hdc.shifts import Shifts
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.stopwatch import Stopwatch
from hdc_place_recognition.verification.geometry import verify
import numpy as np
from numpy.typing import NDArray


class Landmarker:
    """
    Takes the landmarks of images.

    Keypoints and the network share nothing and hold no lock while they work: a thread for each of
    them saves more time than two threads for both, which wait for each other, and burn the CPU
    while they do.

    :param keypoints: gives sizes and angles.
    :param beside: whether to have a thread for it.
    """

    def __init__(self, keypoints: Extractor, beside: bool) -> None:
        self._keypoints = keypoints
        self._pool = ThreadPoolExecutor(1, 'keypoints') if beside else None

    def start(self, image: NDArray[Any]) -> Callable[[], Landmarks]:
        """Return what gives the landmarks when it is called: takes them then, or waits."""
        take = partial(self._take, image)
        return self._pool.submit(take).result if self._pool else take

    def _take(self, image: NDArray[Any]) -> Landmarks:
        return keep(self._keypoints.extract(image))


@dataclass(frozen=True)
class Sight:
    """
    What there is to see in an image.

    :param vectors: (s, d) float32, the image under each displacement; zeros if nothing is seen.
    :param landmarks: to verify it by, None where nothing is verified.
    """

    n_features: int
    vectors: Hypervector
    landmarks: Landmarks | None


class Looker:
    """
    Looks at one image at a time; no image leaves a trace.

    :param extractor: of local features.
    :param keypoints: extractor of what images are verified by, None to verify none.
    :param shifts: under which images are encoded.
    """

    def __init__(
        self,
        params: Params,
        extractor: Extractor,
        keypoints: Extractor | None,
        shifts: Shifts,
    ) -> None:
        self._extractor = extractor
        self._landmarker = Landmarker(keypoints, params.threads > 1) if keypoints else None
        self._encoder = DescriptorEncoder(
            dimensions=params.dimensions,
            n_x=params.n_x,
            n_y=params.n_y,
            preprocessing=params.preprocessing,
            projection=params.projection,
            shifts=shifts,
            seed=params.seed,
        )

    @property
    def verifies(self) -> bool:
        """Return whether there will be landmarks."""
        return self._landmarker is not None

    def look(self, image: NDArray[np.uint8], watch: Stopwatch) -> Sight:
        """
        Return what is seen.

        :param image: (h, w) grey or (h, w, 3) BGR.
        """
        take = self._landmarker.start(image) if self._landmarker else None
        with watch.stage('extract'):
            features = self._extractor.extract(image)
        with watch.stage('encode'):
            vectors = self._encoder.encode(features)
        landmarks = None
        if take is not None:
            with watch.stage('keypoints'):
                landmarks = take()
        return Sight(len(features), vectors, landmarks)

    def warm_up(self, width: int, height: int) -> None:
        """
        Do what the first image of this size would have to wait for.

        It draws the random projection, plans the grid of positions, and makes libraries set up
        what they set up when they are first used.
        """
        noise = np.random.default_rng(0).integers(0, 256, (height, width, 3), np.uint8)
        landmarks = self.look(noise, Stopwatch()).landmarks
        if landmarks is not None:
            verify(landmarks, landmarks)
