# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What an evaluation needs of its input, wherever it comes from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.params.table import Value
from hdc_place_recognition.recognition.keyframes import no_odometry, Odometry
import numpy as np
from numpy.typing import NDArray

Frame = tuple[int, NDArray[np.uint8]]  # stamp in ns; (h, w) gray or (h, w, 3) BGR
Stamps = NDArray[np.int64]


class Frames(Protocol):
    """Images in the order in which the camera saw them; can be gone through several times."""

    def __len__(self) -> int:
        """Return how many images are to be expected, for a progress bar."""

    def __iter__(self) -> Iterator[Frame]:
        """Yield stamp and image."""


@dataclass(frozen=True)
class Truth:
    """
    Which query shows the same place as which database image.

    :param hard: (q, n) bool, the same place: must be found.
    :param soft: (q, n) bool, perhaps the same place: neither right nor wrong where not hard.
    """

    hard: NDArray[np.bool_]
    soft: NDArray[np.bool_]


class GroundTruth(Protocol):
    """Knows which images show the same place, by their stamps."""

    @property
    def summary(self) -> str:
        """Return in a few words what counts as the same place."""

    def truth(self, query_stamps_ns: Stamps, database_stamps_ns: Stamps) -> Truth:
        """Return the truth for the images of these stamps, (q,) and (n,)."""


class Mode(Enum):
    """How the images of a data set are shown to the recognizer."""

    SEQUENCE = 'one sequence, each image against the older ones'
    TRAVERSES = 'two traverses, the queries against the reference'
    RETRIEVAL = 'retrieval, each image against all others'


@dataclass(frozen=True)
class Dataset:
    """
    One input of the evaluation.

    :param name: short name, for tables and the results folder.
    :param mode: how the images are shown to the recognizer.
    :param queries: all images, or those of the second traverse.
    :param reference: the images of the first of two traverses, else None.
    :param ground_truth: None if nothing is known.
    :param overrides: parameters that the data set fixes, such as the gap of a sequence.
    :param camera: that took the images, None if it is not known.
    :param odometry: tells where the robot was.
    """

    name: str
    mode: Mode
    queries: Frames
    reference: Frames | None = None
    ground_truth: GroundTruth | None = None
    overrides: Mapping[str, Value] = field(default_factory=dict)
    camera: Camera | None = None
    odometry: Odometry = no_odometry
