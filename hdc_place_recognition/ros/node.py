# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The node: subscribes to images and publishes loop closures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hdc_place_recognition.conversions.camera_info import camera_from_message
from hdc_place_recognition.conversions.image import image_from_message, stamp_ns
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.formats import NODE_NAME
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import create_recognizer, use_threads
from hdc_place_recognition.recognition.frame_filter import nanoseconds
from hdc_place_recognition.recognition.keyframes import Pose
from hdc_place_recognition.results import Candidate, Detection, Frame, Status
from hdc_place_recognition.ros.diagnostics import Diagnostics
from hdc_place_recognition.ros.image_input import ImageInput
from hdc_place_recognition.ros.keyframe_positions import KeyframePositions
from hdc_place_recognition.ros.log_forwarding import forward_logs, stop_forwarding
from hdc_place_recognition.ros.messages import candidates_message, PublishedCandidate
from hdc_place_recognition.ros.node_statistics import Statistics
from hdc_place_recognition.ros.parameters import RosParameters, unknown_overrides
from hdc_place_recognition.ros.worker import LatestWorker
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, PointCloud2
from std_msgs.msg import Header

_WARN_PERIOD_S = 5.0
_STATUS_PERIOD_S = 10.0
# Size of the image that the recognizer is warmed up with, pixels; the first image of another size
# takes a few milliseconds longer.
_USUAL_SIZE = (640, 480)
_ODOMETRY_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


class PlaceRecognitionNode(Node):
    """
    Runs the recognizer on an image topic.

    Callbacks only receive messages. A worker thread converts and processes the images and
    publishes the results, so that parameters and services stay responsive.

    :param options: of rclpy's Node, to build the node into another process.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(NODE_NAME, **options)
        parameters = RosParameters(self, self._on_parameters)
        params = parameters.params
        self._warn_of_unknown()
        self._log_forwarder = forward_logs(self.get_logger())
        use_threads(params)
        self.recognizer = create_recognizer(params)
        self.recognizer.warm_up(*_USUAL_SIZE)
        self._positions = KeyframePositions(nanoseconds(params.odom_tolerance_s))
        self.recognizer.traverse().odometry = self._positions.pose_before
        self.statistics = Statistics()
        self._candidates = self.create_publisher(PointCloud2, '~/candidates', 10)
        self._closures = self.create_publisher(PointCloud2, '~/loop_closures', 10)
        self.worker = LatestWorker(self._answer)
        self._input = ImageInput(self, params, self.statistics, self._on_image)
        self._odometry = self.create_subscription(
            Odometry, 'odom', self._on_odometry, _ODOMETRY_QOS
        )
        self._camera_info = self.create_subscription(
            CameraInfo, 'camera_info', self._on_camera_info, qos_profile_sensor_data
        )
        self._diagnostics = Diagnostics(self, self._input.problem, self._values)
        self.get_logger().info(
            f'listening to {self._input.topic} ({params.image_transport}, {params.image_qos}), '
            f'features: {self.recognizer.identity}'
        )

    def destroy_node(self) -> None:
        """Stop the worker before the publishers that it uses are destroyed."""
        self.worker.stop(timeout_s=5.0)
        stop_forwarding(self._log_forwarder)
        super().destroy_node()

    def _warn_of_unknown(self) -> None:
        if unknown := unknown_overrides(self):
            self.get_logger().warning(
                f'unknown parameters are ignored: {", ".join(unknown)}; '
                f'`hdc_params --markdown` lists all'
            )

    def _on_parameters(self, params: Params) -> None:
        self.recognizer.params = params
        self._positions.tolerance_ns = nanoseconds(params.odom_tolerance_s)

    def _on_odometry(self, message: Odometry) -> None:
        at, turned = message.pose.pose.position, message.pose.pose.orientation
        pose = Pose((at.x, at.y, at.z), (turned.x, turned.y, turned.z, turned.w))
        self._positions.add_odometry(stamp_ns(message), pose)

    def _on_camera_info(self, message: CameraInfo) -> None:
        """Set the calibration of the camera; without it only rotations are unknown."""
        traverse = self.recognizer.traverse()
        try:
            rectified = self.recognizer.params.image_rectified
            traverse.camera = camera_from_message(message, rectified=rectified)
        except PlaceRecognitionError as error:
            traverse.camera = None
            self.get_logger().warning(str(error), throttle_duration_sec=_WARN_PERIOD_S)

    def _on_image(self, message: Any) -> None:
        self.statistics.dropped += self.worker.put(message)

    def _answer(self, message: Any) -> None:
        """Process an image in the worker thread; no fault of an image may end the thread."""
        try:
            detection = self._recognized(message)
        except PlaceRecognitionError as error:
            self._refuse(str(error))
        except Exception as error:
            self._refuse(f'{type(error).__name__}: {error}')
        else:
            self._publish(message.header, detection)

    def _recognized(self, message: Any) -> Detection:
        """Return the answer to an image, with one snapshot of the parameters."""
        stamp, params = stamp_ns(message), self.recognizer.params
        # An image that will be skipped is not decoded.
        skipped = self.recognizer.skip_reason(stamp, params=params)
        if skipped is not None:
            return Detection(stamp, skipped)
        return self.recognizer.process(Frame(stamp, image_from_message(message)), params)

    def _refuse(self, reason: str) -> None:
        self.statistics.fail(reason)
        self.get_logger().warning(f'image refused: {reason}', throttle_duration_sec=_WARN_PERIOD_S)

    def _publish(self, header: Header, detection: Detection) -> None:
        if not self.statistics.note(detection):
            if detection.status is not Status.TOO_SOON:
                self.get_logger().warning(
                    f'image at {_seconds(detection.stamp_ns)} {detection.status.value}',
                    throttle_duration_sec=_WARN_PERIOD_S,
                )
            return
        if detection.keyframe_id is not None:
            self._positions.add_keyframe(detection.keyframe_id, detection.stamp_ns)
        self._candidates.publish(candidates_message(header, self._located(detection.candidates)))
        for evicted_id in detection.evicted_ids:
            self._positions.evict(evicted_id)
        if detection.not_stored:
            self.get_logger().warning(
                f'image not stored: {detection.not_stored}', throttle_duration_sec=_WARN_PERIOD_S
            )
        if detection.accepted:
            self._closures.publish(candidates_message(header, self._located(detection.accepted)))
            self.get_logger().info(closure_line(detection))
        else:
            self.get_logger().info(
                self.statistics.last_status, throttle_duration_sec=_STATUS_PERIOD_S
            )

    def _located(self, candidates: Sequence[Candidate]) -> list[PublishedCandidate]:
        return [
            PublishedCandidate(candidate, self._positions.position(candidate.match_id))
            for candidate in candidates
        ]

    def _values(self) -> dict[str, str]:
        """Return the values for /diagnostics."""
        database = self.recognizer.database
        return {
            **self.statistics.values(),
            'features': self.recognizer.identity,
            'database keyframes': str(len(database)),
            'database keyframes evicted': str(database.evicted_count),
            'database bytes': str(database.nbytes),
        }


def closure_line(detection: Detection) -> str:
    """Return the best loop closure as a log line."""
    best, more = detection.accepted[0], len(detection.accepted) - 1
    ago_s = (best.query_stamp_ns - best.match_stamp_ns) / 1e9
    return (
        f'loop closure: {_seconds(best.query_stamp_ns)} is the place of '
        f'{_seconds(best.match_stamp_ns)}, {ago_s:.1f} s ago (image {best.match_id}), '
        f'score {best.score:.2f}{f", and {more} more" if more else ""}'
    )


def _seconds(stamp: int) -> str:
    return f'{stamp // 10**9}.{stamp % 10**9 // 10**6:03d} s'
