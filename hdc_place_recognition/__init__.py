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

from importlib import import_module
import logging
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
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
# Modules are loaded when they are used: the node handles signals before it loads numpy.
_MODULES = {
    'PlaceRecognitionError': 'errors',
    'Params': 'params.table',
    **dict.fromkeys(('Candidate', 'Detection', 'Frame', 'Reason', 'Status'), 'results'),
    **dict.fromkeys(('bind', 'bundle', 'create_recognizer', 'evaluate', 'similarity'), 'api'),
}

logging.getLogger(__name__).addHandler(logging.NullHandler())


def __getattr__(name: str) -> Any:
    """Return a name of the public API, from the module that defines it."""
    if name not in _MODULES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_MODULES[name]}'), name)
