# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Poses by stamp, and the association of images with the nearest pose in time."""

from __future__ import annotations

from dataclasses import dataclass
import logging

from hdc_place_recognition.datasets.dataset import Stamps
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.recognition.keyframes import Pose
import numpy as np
from numpy.typing import NDArray

_log = logging.getLogger(__name__)

# A smaller share means that poses and images are probably stamped by different clocks.
MIN_MATCHED_SHARE = 0.5
VIEW_AXES = ('x', 'z')


@dataclass(frozen=True)
class Poses:
    """
    Poses of a robot or camera in one fixed frame.

    :param stamps_ns: (n,) int64, strictly increasing.
    :param positions: (n, 3) float64, meters, finite.
    :param quaternions: (n, 4) float64, x y z w, finite, not necessarily of unit length.
    """

    stamps_ns: Stamps
    positions: NDArray[np.float64]
    quaternions: NDArray[np.float64]

    @classmethod
    def from_rows(cls, stamps_ns: list[int], rows: list[list[float]], source: str) -> Poses:
        """
        Return poses sorted by stamp; for equal stamps the last row is used.

        Rows with NaN or infinity are dropped with a warning. Some filters publish them before
        they are initialized.

        :param stamps_ns: one stamp per row.
        :param rows: x y z of the position in meters and x y z w of the quaternion.
        :param source: file or topic, for error messages.
        :raises PlaceRecognitionError: no row is finite.
        """
        values = np.array(rows, np.float64).reshape(-1, 7)
        finite = np.asarray(np.isfinite(values).all(axis=1))
        if not finite.any():
            raise PlaceRecognitionError(f'{source} has no pose of finite numbers; choose another')
        if not finite.all():
            _log.warning(
                '%s: dropped %d of %d poses that are not finite',
                source,
                np.count_nonzero(~finite),
                len(finite),
            )
        newest_first = np.array(stamps_ns, np.int64)[finite][::-1]
        stamps, index = np.unique(newest_first, return_index=True)
        ordered = values[finite][::-1][index]
        return cls(stamps, ordered[:, :3], ordered[:, 3:])

    def before(self, stamp_ns: int, tolerance_ns: int) -> Pose | None:
        """
        Return the last pose at or before a stamp, None if it is older than the tolerance.

        A position without an orientation, as from satellites, gets the identity.
        """
        index = int(np.searchsorted(self.stamps_ns, stamp_ns, side='right')) - 1
        if index < 0 or stamp_ns - int(self.stamps_ns[index]) > tolerance_ns:
            return None
        (x, y, z), (qx, qy, qz, qw) = self.positions[index], self.quaternions[index]
        known = any((qx, qy, qz, qw))
        return Pose((x, y, z), (qx, qy, qz, qw) if known else (0.0, 0.0, 0.0, 1.0))

    def view_directions(self, axis: str) -> NDArray[np.float64]:
        """
        Return the viewing direction of each pose in the fixed frame.

        :param axis: body axis that points forward: 'x' for a robot's base frame, 'z' for a
            camera's optical frame.
        :return: (n, 3) float64 unit vectors.
        :raises PlaceRecognitionError: a quaternion is all zeros.
        """
        lengths = np.linalg.norm(self.quaternions, axis=1, keepdims=True)
        if not lengths.all():
            raise PlaceRecognitionError(
                'a pose has the orientation 0 0 0 0, which is not a valid quaternion; '
                'use --max-angle 180 to compare only positions'
            )
        x, y, z, w = (self.quaternions / lengths).T
        rotation = {
            'x': (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
            'z': (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
        }
        return np.stack(rotation[axis], axis=1)


def match_poses(poses: Poses, stamps_ns: Stamps, tolerance_ns: int) -> NDArray[np.intp]:
    """
    Return for each image the index of the nearest pose in time.

    :param poses: the poses.
    :param stamps_ns: (n,) int64, stamps of the images.
    :param tolerance_ns: largest time difference between image and pose.
    :return: (n,) intp, -1 if no pose is within the tolerance.
    :raises PlaceRecognitionError: fewer than half of the images have a pose.
    """
    right = np.clip(np.searchsorted(poses.stamps_ns, stamps_ns), 0, len(poses.stamps_ns) - 1)
    left = np.maximum(right - 1, 0)
    gaps = np.abs(poses.stamps_ns[np.stack([left, right])] - stamps_ns)
    nearest = np.where(gaps[0] <= gaps[1], left, right)
    gap = gaps.min(axis=0)
    matched = gap <= tolerance_ns
    _report(matched, gap, tolerance_ns)
    return np.where(matched, nearest, -1)


def _report(matched: NDArray[np.bool_], gap: Stamps, tolerance_ns: int) -> None:
    """Log how many images have a pose; raise an error if fewer than half have one."""
    count, total = np.count_nonzero(matched), len(matched)
    if count < MIN_MATCHED_SHARE * total:
        raise PlaceRecognitionError(
            f'poses for only {count} of {total} images within {tolerance_ns / 1e9:g} s (nearest '
            f'{gap.min() / 1e9:g} s away); check that both are stamped by the same clock, '
            'or increase --odom-tolerance-s'
        )
    largest = gap[matched].max() / 1e9 if count else 0.0
    _log.info('poses for %d of %d images (max. gap %.3g s)', count, total, largest)
