# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The node: subscribes to images and publishes loop closures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.conversions.image import ImageConverter
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.formats import NODE_NAME
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import create_recognizer, use_threads
from hdc_place_recognition.recognition.frame_filter import nanoseconds
from hdc_place_recognition.results import Candidate, Detection, Frame, Status
from hdc_place_recognition.ros.diagnostics import Diagnostics
from hdc_place_recognition.ros.header_stamps import HeaderStamps
from hdc_place_recognition.ros.image_input import ImageInput, LOSS_REMEDY
from hdc_place_recognition.ros.keyframe_positions import KeyframePositions
from hdc_place_recognition.ros.log_forwarding import forward_logs, stop_forwarding
from hdc_place_recognition.ros.messages import candidates_message, PublishedCandidate
from hdc_place_recognition.ros.node_statistics import RecentProblems, Statistics
from hdc_place_recognition.ros.parameters import RosParameters, unknown_overrides
from hdc_place_recognition.ros.side_inputs import CameraInfoInput, OdometryInput
from hdc_place_recognition.ros.worker import LatestWorker
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

_WARN_PERIOD_S = 5.0
_STATUS_PERIOD_S = 10.0
# Size of the image that the recognizer is warmed up with, pixels; the first image of another size
# takes a few milliseconds longer.
_USUAL_SIZE = (640, 480)


@dataclass(frozen=True)
class _Arrived:
    """
    An image message as it has arrived.

    :param time_ns: time of arrival, by the clock of the node.
    :param odometry_count: number of odometry messages before it.
    """

    message: Any
    time_ns: int
    odometry_count: int


class PlaceRecognitionNode(Node):
    """
    Runs the recognizer on an image topic.

    Callbacks only receive messages. A worker thread converts and processes the images and
    publishes the results, so that parameters and services stay responsive.

    :param options: of rclpy's Node, to build the node into another process.
    :raises PlaceRecognitionError: a parameter, a QoS override or the extractor is not usable.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(NODE_NAME, **options)
        self._ros_parameters = RosParameters(self, self._on_parameters)
        params = self._ros_parameters.params
        self._warn_of_unknown()
        self._log_forwarder = forward_logs(self.get_logger())
        use_threads(params)
        self.recognizer = create_recognizer(params)
        self.recognizer.warm_up(*_USUAL_SIZE)
        self._positions = KeyframePositions(nanoseconds(params.odom_tolerance_s))
        self.recognizer.traverse().odometry = self._positions.pose_before
        self.statistics = Statistics()
        self._stamps = HeaderStamps(self.get_logger().warning)
        self._converter = ImageConverter(params.max_image_pixels)
        # Value of _Arrived.odometry_count of the last processed image.
        self._last_odometry_count = 0
        self._candidates = self.create_publisher(PointCloud2, '~/candidates', 10)
        self._closures = self.create_publisher(PointCloud2, '~/loop_closures', 10)
        self.worker = LatestWorker(self._answer, self._on_worker_error)
        self._input = ImageInput(self, params, self.statistics, self._on_image)
        self._odometry = OdometryInput(self, self._positions.add_odometry)
        self._camera_info = CameraInfoInput(self, params.image_rectified, self._on_camera)
        self._recent = RecentProblems(self.statistics, LOSS_REMEDY)
        self._diagnostics = Diagnostics(self, self._problem, self._values, self._input.topic)
        self.get_logger().info(
            f'listening to {self._input.topic} ({params.image_transport}, {params.image_qos}), '
            f'features: {self.recognizer.identity}'
        )

    def destroy_node(self) -> None:
        """Stop the worker before the publishers that it uses are destroyed."""
        self.worker.stop(timeout_s=5.0)
        stop_forwarding(self._log_forwarder)
        super().destroy_node()

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters; a parameter that is fixed at start may be set to its own value."""
        try:
            changes = self._ros_parameters.to_set(parameter_list)
        except PlaceRecognitionError as error:
            return SetParametersResult(successful=False, reason=str(error))
        if not changes:
            return SetParametersResult(successful=True)
        return super().set_parameters_atomically(changes)

    def set_parameters(self, parameter_list: list[Parameter]) -> list[SetParametersResult]:
        """Set parameters one by one, as :meth:`set_parameters_atomically`."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def _warn_of_unknown(self) -> None:
        if unknown := unknown_overrides(self):
            self.get_logger().warning(
                f'unknown parameters are ignored: {", ".join(unknown)}; '
                f'`hdc_params --markdown` lists all'
            )

    def _on_parameters(self, params: Params) -> None:
        self.recognizer.params = params
        self._positions.tolerance_ns = nanoseconds(params.odom_tolerance_s)

    def _on_camera(self, camera: Camera | None) -> None:
        self.recognizer.traverse().camera = camera

    def _on_image(self, message: Any) -> None:
        arrived = _Arrived(message, self.get_clock().now().nanoseconds, self._positions.count)
        self.statistics.dropped += self.worker.put(arrived)

    def _answer(self, arrived: _Arrived) -> None:
        """Process an image in the worker thread; no fault of an image may end the thread."""
        try:
            detection = self._recognized(arrived)
        except PlaceRecognitionError as error:
            self._refuse(str(error))
        except Exception as error:
            self._refuse(f'{type(error).__name__}: {error}')
        else:
            self._publish(arrived.message.header, detection)

    def _on_worker_error(self, error: Exception) -> None:
        """Count an answer that could not be published."""
        self.statistics.unpublished += 1
        self.statistics.last_error = f'{type(error).__name__}: {error}'
        self.get_logger().error(
            f'answer not published: {self.statistics.last_error}',
            throttle_duration_sec=_WARN_PERIOD_S,
        )

    def _recognized(self, arrived: _Arrived) -> Detection:
        """Return the answer to an image, with one snapshot of the parameters."""
        stamp, params = self._stamps.of(arrived.message, arrived.time_ns), self.recognizer.params
        # An image that will be skipped is not decoded.
        skipped = self.recognizer.skip_reason(stamp, params=params)
        if skipped is not None:
            return Detection(stamp, skipped)
        image = self._converter.convert(arrived.message)
        if self.recognizer.begins_session(stamp):
            self._begin_session(stamp, arrived.odometry_count)
        self._last_odometry_count = arrived.odometry_count
        return self.recognizer.process(Frame(stamp, image), params)

    def _begin_session(self, stamp: int, odometry_count: int) -> None:
        self._positions.begin_session(stamp, self._last_odometry_count, odometry_count)
        self.get_logger().info(
            f'the clock was set back to {_seconds(stamp)}: a new session begins',
            throttle_duration_sec=_STATUS_PERIOD_S,
        )

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
        candidates = self._located(detection.candidates)
        for evicted_id in detection.evicted_ids:
            self._positions.evict(evicted_id)
        self._candidates.publish(candidates_message(header, candidates))
        if detection.not_stored:
            self.get_logger().warning(
                f'image not stored: {detection.not_stored}', throttle_duration_sec=_WARN_PERIOD_S
            )
        if detection.accepted:
            accepted = [found for found in candidates if found.candidate.accepted]
            self._closures.publish(candidates_message(header, accepted))
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

    def _problem(self) -> str:
        """Return the problem that diagnostics warn of, '' if there is none."""
        recent = self._recent.problem()
        return self._input.problem() or recent

    def _values(self) -> dict[str, str]:
        """Return the values for /diagnostics."""
        database = self.recognizer.database
        return {
            **self.statistics.values(),
            'image topic': f'{self._input.topic} ({self._input.reliability})',
            'odometry': self._odometry.state,
            'camera_info': self._camera_info.state,
            'session': str(self.recognizer.traverse().session),
            'features': self.recognizer.identity,
            'database keyframes': str(len(database)),
            'database keyframes evicted': str(database.evicted_count),
            'database bytes': str(database.nbytes),
        }


def closure_line(detection: Detection) -> str:
    """Return the best loop closure as a log line."""
    best, more = detection.accepted[0], len(detection.accepted) - 1
    when = f'{(best.query_stamp_ns - best.match_stamp_ns) / 1e9:.1f} s ago'
    if best.match_session != best.query_session:
        when = f'in session {best.match_session}'
    return (
        f'loop closure: {_seconds(best.query_stamp_ns)} is the place of '
        f'{_seconds(best.match_stamp_ns)}, {when} (image {best.match_id}), '
        f'score {best.score:.2f}{f", and {more} more" if more else ""}'
    )


def _seconds(stamp: int) -> str:
    return f'{stamp // 10**9}.{stamp % 10**9 // 10**6:03d} s'
