# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The optional inputs beside the images: odometry and the calibration of the camera."""

from __future__ import annotations

from collections.abc import Callable
import math

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.conversions.camera_info import camera_from_message
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.recognition.keyframes import Pose
from hdc_place_recognition.ros.header_stamps import checked_stamp_ns
from hdc_place_recognition.ros.image_input import camera_info_topic
from hdc_place_recognition.ros.subscription import MatchedSubscription
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import (
    qos_profile_sensor_data,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
)
from sensor_msgs.msg import CameraInfo

_WARN_PERIOD_S = 5.0
_ODOMETRY_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


class OdometryInput:
    """
    Subscribes to the relative topic `odom`; refuses messages that are no finite pose.

    :param received: called with stamp and pose.
    :raises PlaceRecognitionError: a QoS override is not valid.
    """

    def __init__(self, node: Node, received: Callable[[int, Pose], None]) -> None:
        self._logger, self._received = node.get_logger(), received
        self._count = self._refused = 0
        self._last_error = ''
        self._subscription = MatchedSubscription(
            node, Odometry, str(node.resolve_topic_name('odom')), self._on_message, _ODOMETRY_QOS
        )

    @property
    def state(self) -> str:
        """Return what was received, for diagnostics."""
        if not self._count:
            return f'no message on {self._subscription.topic}'
        refused = f', {self._refused} refused: {self._last_error}' if self._refused else ''
        return f'{self._count} messages on {self._subscription.topic}{refused}'

    def _on_message(self, message: Odometry) -> None:
        self._count += 1
        try:
            stamp, pose = checked_stamp_ns(message), pose_from_message(message)
        except PlaceRecognitionError as error:
            self._refused += 1
            self._last_error = str(error)
            self._logger.warning(
                f'odometry refused: {error}', throttle_duration_sec=_WARN_PERIOD_S
            )
        else:
            self._received(stamp, pose)


class CameraInfoInput:
    """
    Subscribes to `camera_info`, by default beside the image topic.

    Messages that were sent before the start are received too, if the publisher keeps them.

    :param rectified: whether the images are rectified.
    :param received: called with the camera, None if it is not calibrated.
    :raises PlaceRecognitionError: a QoS override is not valid.
    """

    def __init__(
        self, node: Node, rectified: bool, received: Callable[[Camera | None], None]
    ) -> None:
        self._logger, self._rectified, self._received = node.get_logger(), rectified, received
        self._subscription = MatchedSubscription(
            node,
            CameraInfo,
            camera_info_topic(node),
            self._on_message,
            qos_profile_sensor_data,
            follows=(QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY),
        )
        self.state = f'no message on {self.topic}'

    @property
    def topic(self) -> str:
        """Return the full name of the topic, after remapping."""
        return self._subscription.topic

    def _on_message(self, message: CameraInfo) -> None:
        """Take the calibration; without it only rotations are unknown."""
        camera, state = None, 'calibrated'
        try:
            camera = camera_from_message(message, rectified=self._rectified)
        except PlaceRecognitionError as error:
            state = str(error)
            # Cameras repeat their calibration with each image.
            if state != self.state:
                self._logger.warning(f'camera_info refused: {error}')
        self.state = state
        self._received(camera)


def pose_from_message(message: Odometry) -> Pose:
    """
    Return the pose of the robot.

    :raises PlaceRecognitionError: a value is not finite.
    """
    at, turned = message.pose.pose.position, message.pose.pose.orientation
    position, orientation = (at.x, at.y, at.z), (turned.x, turned.y, turned.z, turned.w)
    if not all(map(math.isfinite, position + orientation)):
        raise PlaceRecognitionError(
            f'position {position} and orientation {orientation} must be finite; correct the '
            f'source of odometry'
        )
    return Pose(position, orientation)
