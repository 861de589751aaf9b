# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Ground truth from matrices (gt.npz), from poses and from aligned traverses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
import math
from pathlib import Path
from typing import Any, IO
import zipfile

from hdc_place_recognition.bounded_files import MIB, read_bounded
from hdc_place_recognition.datasets.dataset import Stamps, Truth
from hdc_place_recognition.datasets.poses import match_poses, Poses
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray

_FILE_BYTES = 1024 * MIB
_HEADERS: dict[tuple[int, int], Callable[[IO[bytes]], Any]] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
_ANY_ANGLE = 180.0  # degrees, the largest angle between two directions
SOFT_FACTOR = 2.0  # radius and angle of soft pairs, relative to hard pairs
# Aligned traverses: +-2 is the tolerance of stromovka_part1 and gardens_point_thumbs, +-5 that of
# the README of nordland_64x32_part1.
HARD_FRAMES, SOFT_FRAMES = 2, 5


@dataclass(frozen=True)
class MatrixTruth:
    """
    Ground truth given as matrices over all images.

    :param matrices: one row per query image, one column per database image.
    :param query_stamps_ns: (q,) int64, increasing, the stamps of the rows.
    :param database_stamps_ns: (n,) int64, increasing, the stamps of the columns.
    """

    matrices: Truth
    query_stamps_ns: Stamps
    database_stamps_ns: Stamps

    @property
    def summary(self) -> str:
        """Return a short text that says when two images show the same place."""
        return f'matrix of {len(self.query_stamps_ns)} x {len(self.database_stamps_ns)} images'

    def truth(self, query_stamps_ns: Stamps, database_stamps_ns: Stamps) -> Truth:
        """Return the rows and columns of the images with these stamps; all must exist."""
        chosen = np.ix_(
            np.searchsorted(self.query_stamps_ns, query_stamps_ns),
            np.searchsorted(self.database_stamps_ns, database_stamps_ns),
        )
        return Truth(self.matrices.hard[chosen], self.matrices.soft[chosen])


@dataclass(frozen=True)
class PoseTruth:
    """
    Ground truth from the distance between poses and the angle between viewing directions.

    A pair is hard if it is within `radius_m` and `max_angle_deg`, and soft if it is within
    SOFT_FACTOR (2) times both. Pairs of an image without a pose are soft only, so they are
    ignored.

    :param queries: poses of the query images.
    :param database: poses of the database images, in the same fixed frame.
    :param radius_m: largest distance of a hard pair, meters.
    :param max_angle_deg: largest angle of a hard pair, degrees; 180 or more disables the check.
    :param view_axis: body axis that points forward, 'x' (robot) or 'z' (optical frame).
    :param tolerance_ns: largest time difference between an image and its pose.
    """

    queries: Poses
    database: Poses
    radius_m: float
    max_angle_deg: float
    view_axis: str
    tolerance_ns: int

    @property
    def summary(self) -> str:
        """Return a short text that says when two images show the same place."""
        radius, angle = self.radius_m, self.max_angle_deg
        return (
            f'poses within {radius:g} m and {angle:g} deg '
            f'(ignored up to {SOFT_FACTOR * radius:g} m and {SOFT_FACTOR * angle:g} deg)'
        )

    def truth(self, query_stamps_ns: Stamps, database_stamps_ns: Stamps) -> Truth:
        """Return the truth for the images with these stamps."""
        database = self._views(self.database, database_stamps_ns)
        same_images = self.queries is self.database and np.array_equal(
            query_stamps_ns, database_stamps_ns
        )
        queries = database if same_images else self._views(self.queries, query_stamps_ns)
        hard = np.empty((len(query_stamps_ns), len(database_stamps_ns)), np.bool_)
        soft = np.empty_like(hard)
        for row, (position, direction) in enumerate(zip(*queries, strict=True)):
            distance = np.linalg.norm(database[0] - position, axis=1)
            angle = np.degrees(np.arccos(np.clip(database[1] @ direction, -1.0, 1.0)))
            hard[row] = self._within(1.0, distance, angle)
            soft[row] = self._within(SOFT_FACTOR, distance, angle) | np.isnan(distance)
        return Truth(hard, soft)

    def _views(self, poses: Poses, stamps_ns: Stamps) -> tuple[NDArray[np.float64], ...]:
        """Return (n, 3) positions and (n, 3) viewing directions of images; NaN without a pose."""
        index = match_poses(poses, stamps_ns, self.tolerance_ns)
        directions = (
            poses.view_directions(self.view_axis)
            if self.max_angle_deg < _ANY_ANGLE
            else np.zeros_like(poses.positions)
        )
        missing = (index < 0)[:, None]
        return tuple(
            np.where(missing, np.nan, values[index]) for values in (poses.positions, directions)
        )

    def _within(
        self, factor: float, distance: NDArray[np.float64], angle: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return (n,) bool, True within `factor` times the radius and the angle."""
        max_angle = factor * self.max_angle_deg
        return (distance <= factor * self.radius_m) & (
            (angle <= max_angle) | (max_angle >= _ANY_ANGLE)
        )


@dataclass(frozen=True)
class AlignedTruth:
    """
    Ground truth of two traverses whose images of the same index show the same place.

    Images at most HARD_FRAMES (2) apart are hard matches; at most SOFT_FRAMES (5) apart, soft.

    :param interval_ns: time from one image to the next, the same in both traverses.
    """

    interval_ns: int

    @property
    def summary(self) -> str:
        """Return a short text that says when two images show the same place."""
        return f'same index +-{HARD_FRAMES} (ignored up to +-{SOFT_FRAMES})'

    def truth(self, query_stamps_ns: Stamps, database_stamps_ns: Stamps) -> Truth:
        """Return the truth for the images with these stamps."""
        apart_ns = np.abs(query_stamps_ns[:, None] - database_stamps_ns)
        return Truth(
            apart_ns <= HARD_FRAMES * self.interval_ns, apart_ns <= SOFT_FRAMES * self.interval_ns
        )


def load_matrices(path: Path, n_queries: int, n_database: int) -> tuple[Truth, int]:
    """
    Read a ground-truth file in the dataset format.

    :param path: npz file with `hard` and `soft` (q, n), nonzero for a match, and the number
        `min_gap`.
    :param n_queries: number of query images (q).
    :param n_database: number of database images (n).
    :return: the truth and min_gap. In a sequence an image is compared with images that are at
        least min_gap images older; -1 means with all images.
    :raises PlaceRecognitionError: the file cannot be read, or an array is missing or has a wrong
        shape.
    """
    images = (n_queries, n_database)
    content = read_bounded(path, _FILE_BYTES, 'ground truth')
    try:
        with zipfile.ZipFile(BytesIO(content)) as file:
            hard, soft = (_read(file, name, images) != 0 for name in ('hard', 'soft'))
            min_gap = _read(file, 'min_gap', None)
        return Truth(hard, soft), int(min_gap.item())
    except PlaceRecognitionError as error:
        raise PlaceRecognitionError(f'{path}: {error}') from error
    except KeyError as error:
        raise PlaceRecognitionError(
            f'{path}: {error.args[0]}; it needs the arrays hard, soft and min_gap'
        ) from error
    except Exception as error:  # damaged archives raise many types of exceptions
        raise PlaceRecognitionError(f'{path} is not a readable npz file: {error!r}') from error


def _read(file: zipfile.ZipFile, name: str, images: tuple[int, int] | None) -> NDArray[Any]:
    """
    Return an array of numbers of an npz file; nothing is allocated before its shape is checked.

    :param images: expected shape; None for a single number.
    """
    with file.open(f'{name}.npy') as member:
        shape, fortran_order, dtype = _header(member)
        if dtype.kind not in 'biuf':
            raise ValueError(f'{name} holds {dtype}, not numbers')
        if images is None and math.prod(shape) != 1:
            raise PlaceRecognitionError(f'{name} has shape {shape}, expected one number of images')
        if images is not None and shape != images:
            raise PlaceRecognitionError(
                f'{name} has shape {shape}, but the images are {images}; it needs one row per '
                'query and one column per database image, in the order of the files'
            )
        count = math.prod(shape)
        content = member.read(count * dtype.itemsize)
    values = np.frombuffer(content, dtype, count)
    return values.reshape(shape, order='F' if fortran_order else 'C')


def _header(member: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, whether the order is that of Fortran, and dtype of a npy file."""
    version = np.lib.format.read_magic(member)
    if version not in _HEADERS:
        raise ValueError(f'npy format {version} is not supported')
    return _HEADERS[version](member)
