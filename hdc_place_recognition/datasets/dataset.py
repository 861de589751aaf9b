# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The input of an evaluation: images, ground truth, camera and odometry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.params.table import Value
from hdc_place_recognition.recognition.keyframes import no_odometry, Odometry
from hdc_place_recognition.results import Frame
import numpy as np
from numpy.typing import NDArray

Stamps = NDArray[np.int64]  # nanoseconds


class Frames(Protocol):
    """Images in the order in which the camera took them; can be iterated several times."""

    def __len__(self) -> int:
        """Return the expected number of images, for a progress bar."""

    def __iter__(self) -> Iterator[Frame]:
        """Yield the images with their stamps."""


@dataclass(frozen=True)
class Truth:
    """
    Which pairs of a query and a database image show the same place.

    :param hard: (q, n) bool, the pair shows the same place and must be found.
    :param soft: (q, n) bool, the pair may show the same place. A pair that is soft but not hard
        is ignored.
    """

    hard: NDArray[np.bool_]
    soft: NDArray[np.bool_]


class GroundTruth(Protocol):
    """Knows which images show the same place; images are identified by their stamps."""

    @property
    def summary(self) -> str:
        """Return a short text that says when two images show the same place."""

    def truth(self, query_stamps_ns: Stamps, database_stamps_ns: Stamps) -> Truth:
        """Return the truth for queries (q,) and database images (n,) with these stamps."""


class Mode(Enum):
    """How images are compared; the value is shown in the metrics table."""

    SEQUENCE = 'one sequence, each image against the older ones'
    TRAVERSES = 'two traverses, the queries against the reference'
    RETRIEVAL = 'retrieval, each image against all others'


@dataclass(frozen=True)
class Dataset:
    """
    One input of the evaluation.

    :param name: short name, used in tables and for the results folder.
    :param mode: how images are compared.
    :param queries: all images, or with two traverses the images of the second one.
    :param reference: the images of the first of two traverses, otherwise None.
    :param ground_truth: None if it is not known which images show the same place.
    :param overrides: parameters that the dataset sets, such as the minimum age of candidates.
    :param camera: calibration of the camera, None if it is not known.
    :param odometry: returns the pose of the robot at a stamp.
    """

    name: str
    mode: Mode
    queries: Frames
    reference: Frames | None = None
    ground_truth: GroundTruth | None = None
    overrides: Mapping[str, Value] = field(default_factory=dict)
    camera: Camera | None = None
    odometry: Odometry = no_odometry
