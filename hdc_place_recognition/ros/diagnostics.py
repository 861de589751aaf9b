# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The state of the node on /diagnostics, once a second."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

_PERIOD_S = 1.0


class Diagnostics:
    """
    Publishes the state by steady time, so also while a simulation is paused.

    :param problem: returns the problem that the status warns of, '' if there is none.
    :param values: returns keys and values of the status.
    :param hardware_id: what the images come from.
    """

    def __init__(
        self,
        node: Node,
        problem: Callable[[], str],
        values: Callable[[], Mapping[str, str]],
        hardware_id: str,
    ) -> None:
        self._node, self._problem, self._values = node, problem, values
        self._hardware_id = hardware_id
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._timer = node.create_timer(
            _PERIOD_S, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def _publish(self) -> None:
        values, problem = self._values(), self._problem()
        if problem:
            self._node.get_logger().warning(problem, throttle_duration_sec=10.0)
        status = DiagnosticStatus(
            name=f'{self._node.get_fully_qualified_name()}: place recognition',
            hardware_id=self._hardware_id,
            level=DiagnosticStatus.WARN if problem else DiagnosticStatus.OK,
            message=problem or values['last status'],
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
