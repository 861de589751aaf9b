# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Publishes images to the node, receives its answers and calls its parameter services."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import struct
import time

from diagnostic_msgs.msg import DiagnosticArray
from hdc_place_recognition.benchmark.node_process import TOPIC
from hdc_place_recognition.conversions.image import stamp_ns
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.formats import NODE_NAME
import numpy as np
from numpy.typing import NDArray
import psutil
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Image, PointCloud2

_NS = 10**9
# Offset of the stamp in a serialized message.
_STAMP_OFFSET = 4
_READY_S = 60.0
_SETTLED_S = 5.0
# Time between parameter calls, not a multiple of the time between images.
_CALLS_EVERY_S = 0.097
_LIVE = 'min_score', 0.95


@dataclass(frozen=True)
class LoadResult:
    """
    Latencies and counts of one run.

    :param sent: number of published images.
    :param latencies_ms: time from publishing an image to its answer, for each answer.
    :param calls_ms: time of each parameter call during the run.
    :param cpu: CPU time of the process of the node, seconds per second.
    :param lost: images that DDS did not deliver, as counted by the node.
    :param dropped: images that were replaced by newer images while the node was busy.
    :param skipped: images that were skipped by their stamps, or refused by their content.
    """

    sent: int
    latencies_ms: NDArray[np.float64]
    calls_ms: NDArray[np.float64]
    cpu: float
    lost: int
    dropped: int
    skipped: int

    @property
    def answered(self) -> int:
        """Return the number of answered images."""
        return len(self.latencies_ms)

    @property
    def unaccounted(self) -> int:
        """Return the number of images that were neither answered nor counted by the node."""
        return self.sent - self.answered - self.lost - self.dropped - self.skipped


class LoadGenerator(Node):
    """
    Publishes images to the node at a constant rate.

    :param pid: process id of the node.
    """

    def __init__(self, pid: int) -> None:
        super().__init__('hdc_benchmark')
        self._process = psutil.Process(pid)
        self._sent: dict[int, float] = {}
        self._latencies: list[float] = []
        self._calls: list[float] = []
        self._counts: dict[str, int] = {}
        self._images = self.create_publisher(Image, TOPIC, qos_profile_sensor_data)
        self.create_subscription(PointCloud2, f'/{NODE_NAME}/candidates', self._on_answer, 10)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self._parameters = AsyncParameterClient(self, NODE_NAME)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)

    def wait_for_node(self, alive: Callable[[], bool]) -> None:
        """
        Wait until the topics are connected; the node spins when its database is filled.

        :param alive: whether the node's process still runs.
        :raises PlaceRecognitionError: the node has ended, or does not appear.
        """
        if not self._wait(lambda: self._connected() or not alive(), _READY_S) or not alive():
            raise PlaceRecognitionError('the node did not start; see above')

    def run(self, images: Sequence[NDArray[np.uint8]], rate: int, seconds: float) -> LoadResult:
        """Publish the images forward and backward at a rate in Hz, with parameter calls."""
        messages = [_serialized(image) for image in (*images, *images[-2:0:-1])]
        self._sent, self._latencies, self._calls = {}, [], []
        before, cpu_s, start = dict(self._counts), self._cpu_seconds(), time.monotonic()
        calls = self.create_timer(_CALLS_EVERY_S, self._call)
        for number in range(round(rate * seconds)):
            self._spin_until(start + number / rate)
            self._publish(messages[number % len(messages)])
        self._spin_until(start + seconds)
        cpu = (self._cpu_seconds() - cpu_s) / (time.monotonic() - start)
        self.destroy_timer(calls)
        self._wait(lambda: self._result(before, cpu).unaccounted <= 0, _SETTLED_S)
        return self._result(before, cpu)

    def _connected(self) -> bool:
        """Return whether topics and parameter services are connected in both directions."""
        return bool(
            self._images.get_subscription_count()
            and self.count_publishers(f'/{NODE_NAME}/candidates')
            and self._parameters.services_are_ready()
            and self._counts
        )

    def _wait(self, condition: Callable[[], object], seconds: float) -> bool:
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                return False
            self._executor.spin_once(timeout_sec=0.1)
        return True

    def _cpu_seconds(self) -> float:
        """Return the CPU time of the process of the node so far."""
        times = self._process.cpu_times()
        return float(times.user + times.system)

    def _spin_until(self, due: float) -> None:
        while (left := due - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def _publish(self, message: bytearray) -> None:
        stamp = time.time_ns()
        struct.pack_into('<iI', message, _STAMP_OFFSET, *divmod(stamp, _NS))
        self._sent[stamp] = time.perf_counter()
        self._images.publish(bytes(message))

    def _call(self) -> None:
        """Get a parameter, or set it to its present value."""
        start, (name, value) = time.perf_counter(), _LIVE
        if len(self._calls) % 2:
            future = self._parameters.set_parameters([Parameter(name, value=value)])
        else:
            future = self._parameters.get_parameters([name])
        future.add_done_callback(lambda _: self._calls.append((time.perf_counter() - start) * 1e3))

    def _on_answer(self, message: PointCloud2) -> None:
        # Ignore late answers of an earlier run.
        if (start := self._sent.get(stamp_ns(message))) is not None:
            self._latencies.append((time.perf_counter() - start) * 1e3)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if NODE_NAME in status.name:
                self._counts = {
                    item.key: int(item.value) for item in status.values if item.value.isdecimal()
                }

    def _result(self, before: Mapping[str, int], cpu: float) -> LoadResult:
        """Return the result of a run so far; `before` are the counts of the node before it."""

        def since(*starts: str) -> int:
            names = [name for name in self._counts if name.startswith(starts)]
            return sum(self._counts[name] - before[name] for name in names)

        return LoadResult(
            len(self._sent),
            np.array(self._latencies),
            np.array(self._calls),
            cpu,
            lost=since('images lost'),
            dropped=since('images dropped'),
            skipped=since('images skipped', 'images passed over', 'images refused'),
        )


def _serialized(image: NDArray[np.uint8]) -> bytearray:
    """Return a serialized image message, so that publishing it takes little time."""
    height, width, _ = image.shape
    message = Image(height=height, width=width, encoding='bgr8', step=3 * width)
    message.header.frame_id = 'camera'
    message.data = image.tobytes()
    return bytearray(serialize_message(message))
