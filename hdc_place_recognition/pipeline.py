# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Puts the recogniser together from parameters, the same for the node and offline."""

from __future__ import annotations

import cv2
from hdc_place_recognition.core.features import Extractor
from hdc_place_recognition.core.recognizer import PlaceRecognizer
from hdc_place_recognition.features import create_extractor
from hdc_place_recognition.params import Params
import threadpoolctl

# More is slower and, with as many keypoints, no better.
_KEYPOINTS_WIDTH = 320


def create_recognizer(params: Params) -> PlaceRecognizer:
    """
    Return a recogniser with the extractor and on the threads that `params` name.

    The number of threads holds for the whole process: a linear-algebra library with more threads
    than free cores spends its time waiting for itself.

    :raises PlaceRecognitionError: the extractor's package or weights are missing or damaged.
    """
    # Of several, one half looks for keypoints while the other does everything else.
    threads = params.threads // 2 if params.verify and params.threads > 1 else params.threads
    threadpoolctl.threadpool_limits(threads, user_api='blas')
    cv2.setNumThreads(threads)
    extractor = create_extractor(
        params.extractor,
        image_width=params.image_width,
        max_features=params.max_features,
        threads=threads,
    )
    return PlaceRecognizer(params, extractor, _keypoints(params) if params.verify else None)


def _keypoints(params: Params) -> Extractor:
    """Return the extractor of what candidates are verified by."""
    return create_extractor(
        'rootsift', image_width=_KEYPOINTS_WIDTH, max_features=params.verify_features
    )
