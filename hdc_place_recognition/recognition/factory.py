# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Puts the recogniser together from parameters, the same for the node and offline."""

from __future__ import annotations

from pathlib import Path

import cv2
from hdc_place_recognition.database.storage import RowFile
from hdc_place_recognition.database.vector_store import Rows
from hdc_place_recognition.features.local_features import Extractor
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
import threadpoolctl

# More is slower and, with as many keypoints, no better.
_KEYPOINTS_WIDTH = 320


def create_recognizer(params: Params) -> PlaceRecognizer:
    """
    Return a recogniser with the extractor and on the threads that `params` name.

    The number of threads holds for the whole process: a linear-algebra library with more threads
    than free cores spends its time waiting for itself.

    :raises PlaceRecognitionError: the extractor's package or weights are missing or damaged, or
        there is no file for the vectors of the database.
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
    keypoints = _keypoints(params) if params.verify else None
    return PlaceRecognizer(params, extractor, keypoints, create_rows(params))


def create_rows(params: Params) -> Rows:
    """
    Return where the vectors of a database will be.

    :raises PlaceRecognitionError: there can be no file for them.
    """
    room = RowFile(Path(params.rows_folder)) if params.rows_folder else None
    return Rows(params.dimensions, params.row_type, room)


def _keypoints(params: Params) -> Extractor:
    """Return the extractor of what candidates are verified by."""
    return create_extractor(
        'rootsift', image_width=_KEYPOINTS_WIDTH, max_features=params.verify_features
    )
