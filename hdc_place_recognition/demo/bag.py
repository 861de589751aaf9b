# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Writes the drive as a rosbag: images, camera calibration and odometry."""

from __future__ import annotations

from collections.abc import Iterator
import heapq
from pathlib import Path
from typing import Any

from hdc_place_recognition.demo.route import Moment, Route
from hdc_place_recognition.demo.world import CAMERA, StreetWorld
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.errors import WriterError
from rosbags.typesys import get_typestore, Stores

IMAGE_TOPIC, ODOMETRY_TOPIC = '/camera/image_raw', '/odom'
CAMERA_INFO_TOPIC = '/camera/camera_info'
STORAGES = {'sqlite3': StoragePlugin.SQLITE3, 'mcap': StoragePlugin.MCAP}
LAPS = 1.9
_STORE = get_typestore(Stores.ROS2_JAZZY)
_TYPES = {
    IMAGE_TOPIC: 'sensor_msgs/msg/Image',
    CAMERA_INFO_TOPIC: 'sensor_msgs/msg/CameraInfo',
    ODOMETRY_TOPIC: 'nav_msgs/msg/Odometry',
}


def render_sequence(
    seed: int = 0, laps: float = LAPS
) -> Iterator[tuple[Moment, NDArray[np.uint8]]]:
    """Yield the state of the vehicle at each image, and the image, (240, 320, 3) BGR."""
    world = StreetWorld(seed)
    for moment in Route(laps).images():
        yield moment, world.render(moment.pose, moment.lap)


def write_bag(path: Path, *, storage: str = 'sqlite3', laps: float = LAPS, seed: int = 0) -> None:
    """
    Write the drive as a ROS 2 bag, messages in the order of their stamps.

    :param path: folder of the bag, must not exist.
    :param storage: 'sqlite3' or 'mcap'.
    :param laps: number of laps around the block, also a fraction.
    :param seed: seed of the world; the same seed gives the same messages.
    :raises PlaceRecognitionError: the folder exists or cannot be made, or the storage is unknown.
    """
    if storage not in STORAGES:
        raise PlaceRecognitionError(f'bag storage {storage!r} is none of {", ".join(STORAGES)}')
    try:
        with Writer(path, version=9, storage_plugin=STORAGES[storage]) as writer:
            _write(writer, heapq.merge(_camera(seed, laps), _odometry(laps), key=_stamp_ns))
    except (OSError, WriterError) as error:
        raise PlaceRecognitionError(f'cannot write bag {path}: {error}') from error


def _stamp_ns(item: tuple[int, str, Any]) -> int:
    return item[0]


def _write(writer: Writer, messages: Iterator[tuple[int, str, Any]]) -> None:
    connections = {
        topic: writer.add_connection(topic, kind, typestore=_STORE)
        for topic, kind in _TYPES.items()
    }
    for stamp_ns, topic, message in messages:
        writer.write(
            connections[topic], stamp_ns, _STORE.serialize_cdr(message, message.__msgtype__)
        )


def _camera(seed: int, laps: float) -> Iterator[tuple[int, str, Any]]:
    """Yield stamp, topic and message of each calibration and image."""
    for moment, image in render_sequence(seed, laps):
        header, (height, width, _) = _header(moment, 'camera'), image.shape
        yield moment.stamp_ns, CAMERA_INFO_TOPIC, _camera_info(header)
        yield (
            moment.stamp_ns,
            IMAGE_TOPIC,
            _make('sensor_msgs/Image', header, height, width, 'bgr8', 0, 3 * width, image.ravel()),
        )


def _camera_info(header: Any) -> Any:
    matrix = CAMERA.intrinsics
    return _make(
        'sensor_msgs/CameraInfo',
        header,
        CAMERA.height,
        CAMERA.width,
        'plumb_bob',
        np.zeros(5),
        matrix.ravel(),
        np.eye(3).ravel(),
        np.column_stack([matrix, np.zeros(3)]).ravel(),
        0,
        0,
        _make('sensor_msgs/RegionOfInterest', 0, 0, 0, 0, False),
    )


def _odometry(laps: float) -> Iterator[tuple[int, str, Any]]:
    """Yield stamp, topic and message of each odometry sample; odometry is exact."""
    for moment in Route(laps).odometry():
        pose, half = moment.pose, moment.pose.yaw / 2
        position = _make('geometry_msgs/Point', pose.x, pose.y, 0.0)
        turned = _make(
            'geometry_msgs/Quaternion', 0.0, 0.0, float(np.sin(half)), float(np.cos(half))
        )
        twist = _make('geometry_msgs/Twist', _vector(x=moment.speed), _vector(z=moment.yaw_rate))
        exact = np.zeros(36)
        message = _make(
            'nav_msgs/Odometry',
            _header(moment, 'odom'),
            'base_link',
            _make(
                'geometry_msgs/PoseWithCovariance',
                _make('geometry_msgs/Pose', position, turned),
                exact,
            ),
            _make('geometry_msgs/TwistWithCovariance', twist, exact),
        )
        yield moment.stamp_ns, ODOMETRY_TOPIC, message


def _vector(x: float = 0.0, z: float = 0.0) -> Any:
    return _make('geometry_msgs/Vector3', x, 0.0, z)


def _header(moment: Moment, frame: str) -> Any:
    stamp = _make('builtin_interfaces/Time', *divmod(moment.stamp_ns, 10**9))
    return _make('std_msgs/Header', stamp, frame)


def _make(kind: str, *fields: Any) -> Any:
    """Return a message of a type such as 'std_msgs/Header', from all its fields in order."""
    package, name = kind.split('/')
    return _STORE.types[f'{package}/msg/{name}'](*fields)
