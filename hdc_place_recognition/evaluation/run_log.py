# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What the recognizer said of a data set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hdc_place_recognition.datasets.dataset import Stamps
from hdc_place_recognition.results import Detection, Status
import numpy as np
from numpy.typing import NDArray

NOT_STORED = -1
NOT_FOUND = np.float32(-1)  # similarity of an image that can not be found: below all others


@dataclass(frozen=True)
class Recording:
    """
    What the recognizer said.

    :param detections: one a query, in their order; images that were passed over are left out.
    :param database_stamps_ns: (n,) int64, of each image that was to be stored.
    :param rows: (n,) int64, the database row of each of these images, or NOT_STORED.
    :param eligible: (q, n) bool, which of these images each query was to be compared with.
    :param features: local features of each image.
    :param milliseconds: of each image, by stage.
    :param passed_over: how many images the recognizer did not look at, because of their stamps.
    """

    detections: tuple[Detection, ...]
    database_stamps_ns: Stamps
    rows: NDArray[np.int64]
    eligible: NDArray[np.bool_]
    features: tuple[int, ...]
    milliseconds: tuple[Mapping[str, float], ...]
    passed_over: int

    @property
    def query_stamps_ns(self) -> Stamps:
        """Return (q,) int64, the stamps of the detections."""
        return np.array([detection.stamp_ns for detection in self.detections], np.int64)

    @property
    def image_of_row(self) -> NDArray[np.intp]:
        """Return for each database row the index of the image that it is of."""
        return np.flatnonzero(self.rows != NOT_STORED)

    def similarity_matrix(self) -> NDArray[np.float32]:
        """
        Return (q, n) float32, the similarity of each query to each image that was to be stored.

        NOT_FOUND (-1) where there is none: the image was not stored, or the query has no features.
        """
        matrix = np.full(self.eligible.shape, NOT_FOUND, np.float32)
        image_of_row = self.image_of_row
        for row, detection in zip(matrix, self.detections, strict=True):
            if detection.status is not Status.NO_FEATURES:
                row[image_of_row[: len(detection.similarities)]] = detection.similarities
        return matrix

    def score_matrix(self) -> NDArray[np.float32]:
        """Return (q, n) float32, the score of each candidate, NOT_FOUND for what is none."""
        matrix = np.full(self.eligible.shape, NOT_FOUND, np.float32)
        image_of_row = self.image_of_row
        for row, detection in zip(matrix, self.detections, strict=True):
            for candidate in detection.candidates:
                row[image_of_row[candidate.match_id]] = candidate.score
        return matrix

    def cells(self, *, accepted_only: bool = False) -> list[tuple[int, int]]:
        """
        Return where each candidate is in the matrix: query and database image.

        :param accepted_only: leave out the candidates that were not accepted.
        :return: in the order of the queries, best first.
        """
        image_of_row = self.image_of_row
        return [
            (query, int(image_of_row[candidate.match_id]))
            for query, said in enumerate(self.detections)
            for candidate in (said.accepted if accepted_only else said.candidates)
        ]
