# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Converts messages with poses to rows of numbers, for bags.

A message is any object with the fields of nav_msgs/Odometry or Path, geometry_msgs/PoseStamped,
PoseWithCovarianceStamped or TransformStamped, tf2_msgs/TFMessage, or sensor_msgs/NavSatFix.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from hdc_place_recognition.conversions.image import stamp_ns
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray

# The ellipsoid WGS 84: semi-major axis in meters and squared eccentricity.
_AXIS, _ECCENTRICITY_2 = 6378137.0, 6.69437999014e-3
_NO_FIX = -1
# The orientation of a position without one, such as that of a satellite receiver.
UNKNOWN_ORIENTATION = (0.0, 0.0, 0.0, 0.0)


class StampedPose(NamedTuple):
    """
    A pose at a time.

    :param row: x y z of the position in meters and x y z w of the quaternion.
    """

    stamp_ns: int
    row: list[float]


class PoseConverter:
    """
    Converts the messages of one topic.

    :param frames: parent and child frame of the transforms to take, None for the only pair.
    """

    def __init__(self, frames: tuple[str, str] | None = None) -> None:
        self._frames = frames
        self._origin: NDArray[np.float64] | None = None
        self.pairs: set[tuple[str, str]] = set()

    def convert(self, message: Any) -> list[StampedPose]:
        """
        Return the poses of a message; none if it has no pose of the frames or no fix.

        Positions of satellites are converted to east, north and up, from the first position.
        """
        if hasattr(message, 'latitude'):
            return self._fix(message)
        if hasattr(message, 'transforms'):
            return [pose for item in message.transforms for pose in self._transform(item)]
        if hasattr(message, 'transform'):
            return self._transform(message)
        return [_pose(stamped) for stamped in getattr(message, 'poses', [message])]

    def check_frames(self, where: str, flag: str) -> None:
        """
        Check that all transforms were between the same two frames.

        :param where: the topic, for the error message.
        :param flag: command-line flag that selects the frames, for the error message.
        :raises PlaceRecognitionError: several pairs of frames, or not the chosen ones.
        """
        wanted = self._frames is not None and self._frames not in self.pairs
        if self.pairs and (wanted or (self._frames is None and len(self.pairs) > 1)):
            choices = ' | '.join(f'{flag} {":".join(pair)}' for pair in sorted(self.pairs))
            raise PlaceRecognitionError(
                f'{where} has transforms between {len(self.pairs)} pairs of frames; use {choices}'
            )

    def _transform(self, message: Any) -> list[StampedPose]:
        # tf accepts a leading slash in frame names.
        pair = (message.header.frame_id.lstrip('/'), message.child_frame_id.lstrip('/'))
        self.pairs.add(pair)
        if self._frames not in (None, pair):
            return []
        moved, turned = message.transform.translation, message.transform.rotation
        return [_stamped(message, moved, (turned.x, turned.y, turned.z, turned.w))]

    def _fix(self, message: Any) -> list[StampedPose]:
        if message.status.status <= _NO_FIX:
            return []
        angles = np.radians([message.latitude, message.longitude])
        altitude = message.altitude if np.isfinite(message.altitude) else 0.0
        if not np.isfinite(angles).all():
            return []
        geodetic = np.array([*angles, altitude])
        if self._origin is None:
            self._origin = geodetic
        row = [*_east_north_up(geodetic, self._origin).tolist(), *UNKNOWN_ORIENTATION]
        return [StampedPose(stamp_ns(message), row)]


def _pose(stamped: Any) -> StampedPose:
    """Return the pose of a PoseStamped, PoseWithCovarianceStamped or Odometry."""
    pose = getattr(stamped.pose, 'pose', stamped.pose)
    turned = pose.orientation
    return _stamped(stamped, pose.position, (turned.x, turned.y, turned.z, turned.w))


def _stamped(message: Any, at: Any, turned: tuple[float, ...]) -> StampedPose:
    return StampedPose(stamp_ns(message), [at.x, at.y, at.z, *turned])


def _east_north_up(
    geodetic: NDArray[np.float64], origin: NDArray[np.float64]
) -> NDArray[np.float64]:
    """
    Return a position relative to an origin, in meters.

    :param geodetic: (3,) latitude and longitude in radians, altitude in meters; as `origin`.
    """
    latitude, longitude, _ = origin
    sines, cosines = np.sin([latitude, longitude]), np.cos([latitude, longitude])
    axes = np.array(
        [
            [-sines[1], cosines[1], 0.0],
            [-sines[0] * cosines[1], -sines[0] * sines[1], cosines[0]],
            [cosines[0] * cosines[1], cosines[0] * sines[1], sines[0]],
        ]
    )
    return np.asarray(axes @ (_earth_fixed(geodetic) - _earth_fixed(origin)))


def _earth_fixed(geodetic: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a position in the Earth-centered frame, meters."""
    latitude, longitude, altitude = geodetic
    radius = _AXIS / np.sqrt(1.0 - _ECCENTRICITY_2 * np.sin(latitude) ** 2)
    level = (radius + altitude) * np.cos(latitude)
    height = (radius * (1.0 - _ECCENTRICITY_2) + altitude) * np.sin(latitude)
    return np.array([level * np.cos(longitude), level * np.sin(longitude), height])
