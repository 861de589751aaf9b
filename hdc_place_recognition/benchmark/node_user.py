# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A camera before the node, and someone who reads its answers and sets its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import os
from pathlib import Path
import struct
import time

from diagnostic_msgs.msg import DiagnosticArray
from hdc_place_recognition.benchmark.node_process import TOPIC
from hdc_place_recognition.conversions.image import stamp_ns
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.formats import NODE_NAME
import numpy as np
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Image, PointCloud2

_NS = 10**9
# Of a serialised message, where the stamp stands.
_STAMP_OFFSET = 4
_READY_S = 60.0
_SETTLED_S = 5.0
# Parameter calls are this far apart: no multiple of the time between images.
_CALLS_EVERY_S = 0.097
_LIVE = 'min_score', 0.95


@dataclass(frozen=True)
class Ride:
    """
    What came of showing images to the node.

    :param latencies_ms: of each answer, from just before an image was published.
    :param calls_ms: what parameter calls took meanwhile.
    :param cpu: seconds of CPU that the node's process took for each second.
    :param lost: images that DDS did not deliver, as the node knows.
    :param dropped: those that a newer one took the place of while the node was busy.
    :param passed_over: those that their stamps or their content kept from being processed.
    """

    sent: int
    latencies_ms: NDArray[np.float64]
    calls_ms: NDArray[np.float64]
    cpu: float
    lost: int
    dropped: int
    passed_over: int

    @property
    def answered(self) -> int:
        """Return how many images were answered."""
        return len(self.latencies_ms)

    @property
    def unaccounted(self) -> int:
        """Return how many images were neither answered nor counted by the node."""
        return self.sent - self.answered - self.lost - self.dropped - self.passed_over


class User(Node):
    """
    Shows images to the node at a steady rate.

    :param pid: of the node's process.
    """

    def __init__(self, pid: int) -> None:
        super().__init__('hdc_benchmark')
        self._pid = pid
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
        Wait until the node listens and is heard: it spins when its database is full.

        :param alive: whether the node's process still runs.
        :raises PlaceRecognitionError: it has ended, or does not appear.
        """
        if not self._wait(lambda: self._connected() or not alive(), _READY_S) or not alive():
            raise PlaceRecognitionError('the node did not start; see above')

    def ride(self, images: Sequence[NDArray[np.uint8]], rate: int, seconds: float) -> Ride:
        """Show the images to and fro at a rate, in Hz, and call for parameters meanwhile."""
        messages = [_serialised(image) for image in (*images, *images[-2:0:-1])]
        self._sent, self._latencies, self._calls = {}, [], []
        before, cpu_s, start = dict(self._counts), _cpu_seconds(self._pid), time.monotonic()
        calls = self.create_timer(_CALLS_EVERY_S, self._call)
        for number in range(round(rate * seconds)):
            self._spin_until(start + number / rate)
            self._show(messages[number % len(messages)])
        self._spin_until(start + seconds)
        cpu = (_cpu_seconds(self._pid) - cpu_s) / (time.monotonic() - start)
        self.destroy_timer(calls)
        self._wait(lambda: self._ride(before, cpu).unaccounted <= 0, _SETTLED_S)
        return self._ride(before, cpu)

    def _connected(self) -> bool:
        """Return whether images and parameter calls arrive, and answers come back."""
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

    def _spin_until(self, due: float) -> None:
        while (left := due - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def _show(self, message: bytearray) -> None:
        stamp = time.time_ns()
        struct.pack_into('<iI', message, _STAMP_OFFSET, *divmod(stamp, _NS))
        self._sent[stamp] = time.perf_counter()
        self._images.publish(bytes(message))

    def _call(self) -> None:
        """Ask for a parameter, or set it to what it is."""
        start, (name, value) = time.perf_counter(), _LIVE
        if len(self._calls) % 2:
            future = self._parameters.set_parameters([Parameter(name, value=value)])
        else:
            future = self._parameters.get_parameters([name])
        future.add_done_callback(lambda _: self._calls.append((time.perf_counter() - start) * 1e3))

    def _on_answer(self, message: PointCloud2) -> None:
        # An answer that came too late for the ride before counts for none.
        if (start := self._sent.get(stamp_ns(message))) is not None:
            self._latencies.append((time.perf_counter() - start) * 1e3)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.startswith(NODE_NAME):
                self._counts = {
                    each.key: int(each.value) for each in status.values if each.value.isdecimal()
                }

    def _ride(self, before: Mapping[str, int], cpu: float) -> Ride:
        """Return what is known of a ride before which the node had counted this."""

        def since(*starts: str) -> int:
            names = [name for name in self._counts if name.startswith(starts)]
            return sum(self._counts[name] - before[name] for name in names)

        return Ride(
            len(self._sent),
            np.array(self._latencies),
            np.array(self._calls),
            cpu,
            lost=since('images lost'),
            dropped=since('images dropped'),
            passed_over=since('images passed over', 'images refused'),
        )


def _serialised(image: NDArray[np.uint8]) -> bytearray:
    """Return an image message as it travels, so that sending it costs a camera little."""
    height, width, _ = image.shape
    message = Image(height=height, width=width, encoding='bgr8', step=3 * width)
    message.header.frame_id = 'camera'
    message.data = image.tobytes()
    return bytearray(serialize_message(message))


def _cpu_seconds(pid: int) -> float:
    """Return the CPU time of a process so far."""
    after_name = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return sum(map(int, after_name[11:13])) / os.sysconf('SC_CLK_TCK')
