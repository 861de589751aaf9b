# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Visual loop-closure detection with hyperdimensional computing.

>>> import hdc_place_recognition as hpr
>>> recognizer = hpr.create_recognizer(extractor='gradient_grid')
>>> recognizer.params.extractor
'gradient_grid'
"""

from __future__ import annotations

import logging

from hdc_place_recognition.api import (
    bind,
    bundle,
    create_recognizer,
    evaluate,
    similarity,
)
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.results import Candidate, Detection, Frame, Reason, Status

__version__ = '0.1.0'
__all__ = [
    'Candidate',
    'Detection',
    'Frame',
    'Params',
    'PlaceRecognitionError',
    'Reason',
    'Status',
    'bind',
    'bundle',
    'create_recognizer',
    'evaluate',
    'similarity',
]

logging.getLogger(__name__).addHandler(logging.NullHandler())
