# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Plays a bag through real topics and collects the answers of the node."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
import time

from hdc_place_recognition.conversions.image import stamp_ns
from hdc_place_recognition.demo.bag import CAMERA_INFO_TOPIC, IMAGE_TOPIC, ODOMETRY_TOPIC
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.formats import NODE_NAME
from hdc_place_recognition.results import Candidate
from hdc_place_recognition.ros.messages import read_candidates
from nav_msgs.msg import Odometry
import rclpy
from rclpy.node import Node
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores
from sensor_msgs.msg import CameraInfo, Image, PointCloud2

_TYPES = {CAMERA_INFO_TOPIC: CameraInfo, IMAGE_TOPIC: Image, ODOMETRY_TOPIC: Odometry}
_DISCOVERY_S = 30.0
# Time to wait for the answer to an image before the next image is published.
_ANSWER_S = 5.0
_LAST_CLOSURES_S = 0.5


class Player(Node):
    """
    Publishes the messages of a bag and subscribes to the answers of the node.

    An image is published when the image before it is answered, hence as fast as the node can.
    Closures are printed and collected, with the stamps of the answered images.
    """

    def __init__(self) -> None:
        super().__init__('hdc_demo')
        self.answered_ns: list[int] = []
        self.closures: list[Candidate] = []
        self._topic_publishers = {
            topic: self.create_publisher(kind, topic, 10) for topic, kind in _TYPES.items()
        }
        self._answers = self.create_subscription(
            PointCloud2, f'/{NODE_NAME}/candidates', self._on_answer, 10
        )
        self._loop_closures = self.create_subscription(
            PointCloud2, f'/{NODE_NAME}/loop_closures', self._on_closures, 10
        )

    def wait_for_node(self, alive: Callable[[], bool]) -> None:
        """
        Wait until the topics are connected in both directions.

        :param alive: whether the node's process still runs.
        :raises PlaceRecognitionError: the node has ended, or does not appear.
        """
        end = time.monotonic() + _DISCOVERY_S
        while not self._connected():
            if not alive():
                raise PlaceRecognitionError('the node ended before it was ready; see above')
            if time.monotonic() > end:
                raise PlaceRecognitionError(
                    f'the node did not appear within {_DISCOVERY_S:g} s; is discovery between '
                    f'processes blocked (ROS_AUTOMATIC_DISCOVERY_RANGE, firewall)?'
                )
            rclpy.spin_once(self, timeout_sec=0.1)

    def play(self, messages: Iterable[tuple[str, bytes, int]]) -> None:
        """
        Publish messages in their order, and wait for the answers.

        :param messages: topic, serialized message, header stamp.
        """
        for topic, raw, sent_ns in messages:
            self._topic_publishers[topic].publish(raw)
            if topic == IMAGE_TOPIC:
                self._spin(_ANSWER_S, until_ns=sent_ns)
        # The closures of the last image come after its answer.
        self._spin(_LAST_CLOSURES_S)

    def _connected(self) -> bool:
        connected = all(item.get_subscription_count() for item in self._topic_publishers.values())
        inputs = (self._answers, self._loop_closures)
        return connected and all(self.count_publishers(topic.topic_name) for topic in inputs)

    def _spin(self, seconds: float, until_ns: int | None = None) -> None:
        """Spin for some seconds, or until the image with this stamp is answered."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and (until_ns is None or self.answered_ns[-1:] != [until_ns]):
            rclpy.spin_once(self, timeout_sec=0.1)

    def _on_answer(self, message: PointCloud2) -> None:
        self.answered_ns.append(stamp_ns(message))

    def _on_closures(self, message: PointCloud2) -> None:
        published = read_candidates(message)
        self.closures += [item.candidate for item in published]
        best = published[0].candidate
        ago_s = (best.query_stamp_ns - best.match_stamp_ns) / 1e9
        x, y, _ = published[0].position
        print(
            f'loop closure: seen {ago_s:5.1f} s ago, at x {x:6.1f} m, y {y:6.1f} m, '
            f'probability {best.score:.2f}',
            flush=True,
        )


def raw_messages(bag: Path) -> Iterator[tuple[str, bytes, int]]:
    """Yield topic, serialized message and header stamp of each message for the node."""
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        chosen = [connection for connection in reader.connections if connection.topic in _TYPES]
        for connection, _, raw in reader.messages(chosen):
            message = reader.deserialize(raw, connection.msgtype)
            yield connection.topic, bytes(raw), stamp_ns(message)
