# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Taking the landmarks of an image, beside whatever else is done with it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

from hdc_place_recognition.features.compact import keep, Landmarks
from hdc_place_recognition.features.local_features import Extractor
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
