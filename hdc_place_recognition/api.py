# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The public functions of the package, for use from Python; see doc/python_example.md."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, TYPE_CHECKING

from hdc_place_recognition.hdc import algebra
from hdc_place_recognition.hdc.algebra import Hypervector
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition import factory
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
import numpy as np

if TYPE_CHECKING:
    from hdc_place_recognition.evaluation.evaluate import Evaluation


def create_recognizer(**params: Any) -> PlaceRecognizer:
    """
    Return a recognizer with an empty database.

    >>> recognizer = create_recognizer(extractor='gradient_grid', min_interval_s=0.0)
    >>> black = recognizer.encode(np.zeros((240, 320), np.uint8))
    >>> black.shape, bool(black.any())
    ((4096,), False)

    :param params: any parameter by name (doc/parameters.md); the others have their defaults.
    :raises PlaceRecognitionError: a parameter is unknown or out of range, or what the extractor
        needs is missing.
    """
    return factory.create_recognizer(Params.from_dict(params))


def similarity(a: Hypervector, b: Hypervector) -> float:
    """
    Return the cosine of two hypervectors, -1 to 1; 0 with a zero vector.

    >>> similarity(np.array([1, 1], np.float32), np.array([1, -1], np.float32))
    0.0

    :param a: (d,) float32.
    :param b: (d,) float32.
    """
    return float(algebra.cosine_similarity(a, b))


def bind(a: Hypervector, b: Hypervector) -> Hypervector:
    """
    Return the elementwise product, unlike both inputs; binding again with one undoes it.

    >>> a, b = np.array([1, -1, 1], np.float32), np.array([-1, -1, 1], np.float32)
    >>> bind(bind(a, b), b).tolist()
    [1.0, -1.0, 1.0]

    :param a: (..., d) float32.
    :param b: (..., d) float32.
    """
    return algebra.bind(a, b)


def bundle(vectors: Iterable[Hypervector]) -> Hypervector:
    """
    Return the elementwise sum, which is similar to each input.

    >>> bundle([np.array([1, -1], np.float32), np.array([1, 1], np.float32)]).tolist()
    [2.0, 0.0]

    :param vectors: one or more, (d,) float32 each.
    :return: (d,) float32.
    """
    return algebra.bundle(np.stack(list(vectors)))


def evaluate(path: str | Path, **options: Any) -> Evaluation:
    """
    Run the recognizer on a bag or folder of images, and measure its answers.

    :param path: a rosbag, or a folder with images/ (doc/evaluation.md).
    :param options: of :func:`hdc_place_recognition.evaluation.evaluate.evaluate_input`, and any
        parameter by name.
    :return: with the property `metrics`, as in metrics.json.
    :raises PlaceRecognitionError: the input or a parameter cannot be used.
    """
    # Evaluation needs rosbags and more, which a robot does without.
    from hdc_place_recognition.evaluation.evaluate import evaluate_input

    return evaluate_input(Path(path), **options)
