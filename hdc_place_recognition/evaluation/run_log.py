# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""All detections of a run on a dataset, as matrices of queries and database images."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hdc_place_recognition.datasets.dataset import Stamps
from hdc_place_recognition.results import Detection, Status
import numpy as np
from numpy.typing import NDArray

NOT_STORED = -1
NOT_FOUND = np.float32(-1)  # below every similarity, for images that cannot be found


@dataclass(frozen=True)
class RunLog:
    """
    All detections of a run on a dataset. Skipped images are not part of it.

    A database image is an image that was offered to the database, stored or not.

    :param detections: one per query, in the order of the queries.
    :param database_stamps_ns: (n,) int64, stamps of the database images.
    :param keyframe_ids: (n,) int64, keyframe id of each database image, NOT_STORED (-1) if it was
        not stored.
    :param eligible: (q, n) bool, True where a query should be compared with a database image.
    :param features: number of local features of each image.
    :param milliseconds: times of each image by stage.
    :param skipped: number of images that were skipped because of their stamps.
    """

    detections: tuple[Detection, ...]
    database_stamps_ns: Stamps
    keyframe_ids: NDArray[np.int64]
    eligible: NDArray[np.bool_]
    features: tuple[int, ...]
    milliseconds: tuple[Mapping[str, float], ...]
    skipped: int

    @property
    def query_stamps_ns(self) -> Stamps:
        """Return (q,) int64, the stamps of the queries."""
        return np.array([detection.stamp_ns for detection in self.detections], np.int64)

    @property
    def image_of_keyframe(self) -> NDArray[np.intp]:
        """Return for each keyframe id the index of its database image."""
        return np.flatnonzero(self.keyframe_ids != NOT_STORED)

    def similarity_matrix(self) -> NDArray[np.float32]:
        """
        Return (q, n) float32, the similarity of each query and database image.

        NOT_FOUND (-1) if the image was not stored or the query has no features.
        """
        matrix = np.full(self.eligible.shape, NOT_FOUND, np.float32)
        image_of_keyframe = self.image_of_keyframe
        for row, detection in zip(matrix, self.detections, strict=True):
            if detection.status is not Status.NO_FEATURES:
                compared = image_of_keyframe[: len(detection.similarities)]
                row[compared] = detection.similarities
        return matrix

    def score_matrix(self) -> NDArray[np.float32]:
        """Return (q, n) float32, the score of each candidate; NOT_FOUND (-1) elsewhere."""
        matrix = np.full(self.eligible.shape, NOT_FOUND, np.float32)
        image_of_keyframe = self.image_of_keyframe
        for row, detection in zip(matrix, self.detections, strict=True):
            for candidate in detection.candidates:
                row[image_of_keyframe[candidate.match_id]] = candidate.score
        return matrix

    def cells(self, *, accepted_only: bool = False) -> list[tuple[int, int]]:
        """
        Return the matrix cell (query, database image) of each candidate.

        :param accepted_only: return only accepted candidates.
        :return: cells in the order of the queries, the best candidate of a query first.
        """
        image_of_keyframe = self.image_of_keyframe
        return [
            (query, int(image_of_keyframe[candidate.match_id]))
            for query, detection in enumerate(self.detections)
            for candidate in (detection.accepted if accepted_only else detection.candidates)
        ]
