# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Ground truth from matrices and from poses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile
import zlib

from hdc_place_recognition.datasets.dataset import Stamps, Truth
from hdc_place_recognition.datasets.poses import match_poses, Poses
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray

# What numpy raises over files that are no npz, are cut off, or hold objects.
_DAMAGED = (OSError, ValueError, EOFError, TypeError, AttributeError, BadZipFile, zlib.error)
_ANY_ANGLE = 180.0  # degrees; no two directions are further apart
SOFT_FACTOR = 2.0  # soft pairs lie within twice the radius and twice the angle of hard ones


@dataclass(frozen=True)
class MatrixTruth:
    """
    Ground truth that is given as matrices over all images.

    :param whole: the truth, a row a query image and a column a database image.
    :param query_stamps_ns: (q,) int64 rising, the stamps of the rows.
    :param database_stamps_ns: (n,) int64 rising, the stamps of the columns.
    """

    whole: Truth
    query_stamps_ns: Stamps
    database_stamps_ns: Stamps

    @property
    def summary(self) -> str:
        """Return in a few words what counts as the same place."""
        return f'matrix of {len(self.query_stamps_ns)} x {len(self.database_stamps_ns)} images'

    def truth(self, query_stamps_ns: Stamps, database_stamps_ns: Stamps) -> Truth:
        """Return the truth for the images of these stamps, which must be among all."""
        chosen = np.ix_(
            np.searchsorted(self.query_stamps_ns, query_stamps_ns),
            np.searchsorted(self.database_stamps_ns, database_stamps_ns),
        )
        return Truth(self.whole.hard[chosen], self.whole.soft[chosen])


@dataclass(frozen=True)
class PoseTruth:
    """
    Ground truth by the distance of poses and the angle between the directions of view.

    Hard: at most `radius_m` apart and `max_angle_deg` turned against each other. Soft: within
    SOFT_FACTOR (2) times both. An image without a pose matches nothing hard and everything soft,
    so that its pairs are ignored.

    :param queries: poses of the query images.
    :param database: poses of the database images, in the same fixed frame.
    :param radius_m: greatest distance of a hard pair, meters.
    :param max_angle_deg: greatest angle of a hard pair, degrees; from 180 on it is not looked at.
    :param view_axis: the body's axis that looks ahead, 'x' (robot) or 'z' (optical frame).
    :param tolerance_ns: greatest time between an image and its pose.
    """

    queries: Poses
    database: Poses
    radius_m: float
    max_angle_deg: float
    view_axis: str
    tolerance_ns: int

    @property
    def summary(self) -> str:
        """Return in a few words what counts as the same place."""
        radius, angle = self.radius_m, self.max_angle_deg
        return (
            f'poses within {radius:g} m and {angle:g} deg '
            f'(ignored up to {SOFT_FACTOR * radius:g} m and {SOFT_FACTOR * angle:g} deg)'
        )

    def truth(self, query_stamps_ns: Stamps, database_stamps_ns: Stamps) -> Truth:
        """Return the truth for the images of these stamps."""
        database = self._views(self.database, database_stamps_ns)
        alike = self.queries is self.database and np.array_equal(
            query_stamps_ns, database_stamps_ns
        )
        queries = database if alike else self._views(self.queries, query_stamps_ns)
        hard = np.empty((len(query_stamps_ns), len(database_stamps_ns)), np.bool_)
        soft = np.empty_like(hard)
        for row, (position, direction) in enumerate(zip(*queries, strict=True)):
            distance = np.linalg.norm(database[0] - position, axis=1)
            angle = np.degrees(np.arccos(np.clip(database[1] @ direction, -1.0, 1.0)))
            hard[row] = self._within(1.0, distance, angle)
            soft[row] = self._within(SOFT_FACTOR, distance, angle) | np.isnan(distance)
        return Truth(hard, soft)

    def _views(self, poses: Poses, stamps_ns: Stamps) -> tuple[NDArray[np.float64], ...]:
        """Return (n, 3) positions and (n, 3) directions of view of images, NaN without a pose."""
        index = match_poses(poses, stamps_ns, self.tolerance_ns)
        directions = (
            poses.view_directions(self.view_axis)
            if self.max_angle_deg < _ANY_ANGLE
            else np.zeros_like(poses.positions)
        )
        missing = (index < 0)[:, None]
        return tuple(np.where(missing, np.nan, of[index]) for of in (poses.positions, directions))

    def _within(
        self, factor: float, distance: NDArray[np.float64], angle: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return (n,) bool, whether images are within the factor's radius and angle."""
        max_angle = factor * self.max_angle_deg
        return (distance <= factor * self.radius_m) & (
            (angle <= max_angle) | (max_angle >= _ANY_ANGLE)
        )


def load_matrices(path: Path, n_queries: int, n_database: int) -> tuple[Truth, int]:
    """
    Read a ground-truth file of the data-set format.

    :param path: an npz with `hard` and `soft` (q, n), not 0 = match, and `min_gap` (a number).
    :param n_queries: how many query images there are.
    :param n_database: how many database images there are.
    :return: the truth, and min_gap: in one sequence only images at least so many older count as
        database; -1 where all do.
    :raises PlaceRecognitionError: not readable, an array is missing, or of another shape.
    """
    arrays = _load(path)
    images = (n_queries, n_database)
    for name in ('hard', 'soft'):
        if arrays[name].shape != images:
            raise PlaceRecognitionError(
                f'{path}: {name} has shape {arrays[name].shape}, but the images are {images}; '
                'it needs a row for each query and a column for each database image, in the '
                'sorted order of the files'
            )
    if arrays['min_gap'].size != 1:
        raise PlaceRecognitionError(
            f'{path}: min_gap has shape {arrays["min_gap"].shape}, expected one number of images'
        )
    return Truth(arrays['hard'] != 0, arrays['soft'] != 0), int(arrays['min_gap'].item())


def _load(path: Path) -> dict[str, NDArray[Any]]:
    """Return the three arrays of a ground-truth file."""
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in ('hard', 'soft', 'min_gap')}
    except KeyError as error:
        raise PlaceRecognitionError(
            f'{path}: {error.args[0]}; it needs the arrays hard, soft and min_gap'
        ) from error
    except _DAMAGED as error:
        raise PlaceRecognitionError(f'{path} is not a readable npz file: {error}') from error
