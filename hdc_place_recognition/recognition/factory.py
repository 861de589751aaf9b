# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Assembles the recognizer from parameters, the same for the node and the offline tools."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
import json
import logging
from pathlib import Path

import cv2
from hdc_place_recognition.database.eviction import Capacity
from hdc_place_recognition.database.memory import MemoryDatabase
from hdc_place_recognition.database.storage import FileStorage
from hdc_place_recognition.database.vector_store import VectorStore
from hdc_place_recognition.features.compact import KEYPOINT_WIDTH
from hdc_place_recognition.features.local_features import Extractor
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.hdc.image_descriptor import DescriptorEncoder
from hdc_place_recognition.hdc.shifts import Shifts
from hdc_place_recognition.hdc.words import WordHasher
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.image_encoder import ImageEncoder
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
from hdc_place_recognition.verification.scoring import Scorer
from hdc_place_recognition.verification.settings import Calibration, VerificationSettings
from hdc_place_recognition.verification.verifier import CandidateVerifier
import threadpoolctl

_CALIBRATIONS = 'calibration.json'
_log = logging.getLogger(__name__)


def create_recognizer(params: Params) -> PlaceRecognizer:
    """
    Return a recognizer with the extractor that the parameters name.

    No global state is changed; :func:`use_threads` sets the threads of a whole process.

    :raises PlaceRecognitionError: the package or the weights of the extractor are missing or
        damaged, or no file can be created for the vectors.
    """
    with limited_threads(params):
        extractor = create_extractor(
            params.extractor,
            image_width=params.image_width,
            max_features=params.max_features,
            threads=library_threads(params),
        )
        keypoints = _keypoint_extractor(params) if params.verify else None
        return assemble(params, extractor, keypoints)


def assemble(
    params: Params, extractor: Extractor, keypoints: Extractor | None = None
) -> PlaceRecognizer:
    """
    Return a recognizer with given extractors.

    :param extractor: of the local features that are bundled.
    :param keypoints: extractor of verification keypoints, None for no verification.
    :raises PlaceRecognitionError: no file can be created for the vectors.
    """
    shifts = Shifts(params.displacements_x, params.displacements_y, params.displacement_step)
    descriptor = DescriptorEncoder(
        dimensions=params.dimensions,
        n_x=params.n_x,
        n_y=params.n_y,
        preprocessing=params.preprocessing,
        projection=params.projection,
        shifts=shifts,
        seed=params.seed,
    )
    database = create_database(params, shifts)
    scorer = Scorer(VerificationSettings(), *calibrations(extractor.identity))
    return PlaceRecognizer(
        params,
        ImageEncoder(
            extractor,
            descriptor,
            keypoints,
            WordHasher(seed=params.seed),
            parallel=params.threads > 1,
        ),
        database,
        CandidateVerifier(database, shifts.offsets, scorer),
    )


def create_database(params: Params, shifts: Shifts) -> MemoryDatabase:
    """
    Return an empty database.

    :raises PlaceRecognitionError: no file can be created for the vectors.
    """
    storage = FileStorage(Path(params.rows_folder)) if params.rows_folder else None
    return MemoryDatabase(
        VectorStore(params.dimensions, params.row_type, storage),
        len(shifts.offsets),
        params.center_database,
        shifts.groups,
        Capacity(params.max_keyframes, params.max_database_mb),
    )


def library_threads(params: Params) -> int:
    """Return the threads of BLAS, OpenCV and the network: half of two or more, if verified."""
    return params.threads // 2 if params.verify and params.threads > 1 else params.threads


def use_threads(params: Params) -> None:
    """
    Set the threads of BLAS and OpenCV for the whole process; for the node.

    A linear-algebra library with more threads than free cores spends its time waiting for itself.
    """
    threadpoolctl.threadpool_limits(library_threads(params), user_api='blas')
    cv2.setNumThreads(library_threads(params))


@contextmanager
def limited_threads(params: Params) -> Iterator[None]:
    """Set the threads of BLAS and OpenCV inside, and restore them afterwards."""
    before = cv2.getNumThreads()
    with threadpoolctl.threadpool_limits(library_threads(params), user_api='blas'):
        cv2.setNumThreads(library_threads(params))
        try:
            yield
        finally:
            cv2.setNumThreads(before)


def _keypoint_extractor(params: Params) -> Extractor:
    return create_extractor(
        'rootsift', image_width=KEYPOINT_WIDTH, max_features=params.verify_features
    )


def calibrations(identity: str) -> tuple[Calibration, Calibration]:
    """Return the tables of an extractor, verified and unverified; warn if there is none."""
    tables = json.loads(
        files('hdc_place_recognition.verification').joinpath(_CALIBRATIONS).read_text('utf-8')
    )
    known = tables['extractors']
    if identity not in known:
        _log.warning(
            'the score is not calibrated for the features "%s"; it uses the calibration of "%s". '
            '`hdc_experiments calibrate` fits one',
            identity,
            tables['default'],
        )
    table = known.get(identity, known[tables['default']])
    verified, unverified = (
        Calibration(table[kind]['slope'], table[kind]['center'])
        for kind in ('verified', 'unverified')
    )
    return verified, unverified
