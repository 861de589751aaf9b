# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The node beside a user's node in this process; needs rclpy."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any

from conftest import CellExtractor, texture
from hdc_place_recognition.recognition.factory import assemble
from hdc_place_recognition.ros import node as node_module
from nav_msgs.msg import Odometry
import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import Image

S = 1_000_000_000
SOON_S = 10.0
NAME = '/place_recognition_node'


class Bench:
    """The node beside a user's node, turned by one executor."""

    def __init__(self, *words: str) -> None:
        self.node = node_module.PlaceRecognitionNode(
            cli_args=[
                '--ros-args',
                '-r',
                'image:=/camera/image_raw',
                '-p',
                'image_qos:=reliable',
                '-p',
                'exclude_recent_s:=5.0',
                *words,
            ]
        )
        self.user = Node('user')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.user)
        self.images = self.user.create_publisher(Image, '/camera/image_raw', 10)
        self.odometry = self.user.create_publisher(Odometry, '/odom', 100)

    def heard(self, kind: type, topic: str) -> list[Any]:
        messages: list[Any] = []
        self.user.create_subscription(kind, topic, messages.append, 100)
        return messages

    def until(self, condition: Callable[[], object]) -> None:
        end = time.monotonic() + SOON_S
        while not condition():
            assert time.monotonic() < end, 'waited in vain'
            self.executor.spin_once(timeout_sec=0.02)

    def show(self, second: float, image: np.ndarray | None, **changes: Any) -> None:
        """Publish an image and wait until the node has dealt with it."""
        received = self.node.statistics.received
        self.images.publish(image_message(second, image, **changes))
        self.until(lambda: self.node.statistics.received > received)
        assert self.node.worker.wait_idle(SOON_S)

    def close(self) -> None:
        self.executor.shutdown()
        self.user.destroy_node()
        self.node.destroy_node()


def image_message(second: float, image: np.ndarray | None, **changes: Any) -> Image:
    pixels = texture(0) if image is None else image
    message = Image(
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding='mono8',
        step=pixels.shape[1],
        data=pixels.tobytes(),
    )
    set_stamp(message, second)
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def set_stamp(message: Any, second: float) -> None:
    message.header.frame_id = 'camera'
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(round(second * S), S)


def start_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    """Initialize ROS; nodes get an extractor that needs no weights."""
    monkeypatch.setattr(
        node_module, 'create_recognizer', lambda params: assemble(params, CellExtractor())
    )
    rclpy.init(args=[])


def parameter(bench: Bench, call: str, argument: Any) -> Any:
    client = AsyncParameterClient(bench.user, NAME)
    bench.until(client.services_are_ready)
    future = getattr(client, call)(argument)
    bench.until(future.done)
    return future.result()
