# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command place_recognition_node: how the node starts and ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
import signal
import sys

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params_io import NODE_NAME
from hdc_place_recognition.ros.node import PlaceRecognitionNode
import rclpy
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import LoggingSeverity, set_logger_level

_ROS_ERROR = rclpy_implementation.RCLError
_START_ERRORS = (
    PlaceRecognitionError,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    _ROS_ERROR,
)


def main(
    argv: Sequence[str] | None = None,
    create: Callable[[], PlaceRecognitionNode] = PlaceRecognitionNode,
) -> int:
    """Run the node until it is interrupted; 2 if it cannot start, with one line that says why."""
    node = None
    try:
        _initialize(argv)
        # Made first: a signal that comes before the node spins finds it complete.
        executor = SingleThreadedExecutor()
        node = create()
        _spin(executor, node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except _START_ERRORS as error:
        print(f'{NODE_NAME}: {" ".join(str(error).split())}', file=sys.stderr)
        return 2
    finally:
        _end(node)
    return 0


def _initialize(argv: Sequence[str] | None) -> None:
    """Start rclpy; what its C library logs of bad arguments, the exception says too."""
    set_logger_level('rcl', LoggingSeverity.FATAL)
    rclpy.init(args=argv)
    set_logger_level('rcl', LoggingSeverity.UNSET)


def _spin(executor: SingleThreadedExecutor, node: PlaceRecognitionNode) -> None:
    """Spin until the context is shut down."""
    executor.add_node(node)
    try:
        executor.spin()
    except _ROS_ERROR:
        # A signal between two waits leaves the executor with a context that has gone.
        if rclpy.ok():
            raise


def _end(node: PlaceRecognitionNode | None) -> None:
    """Clean up; under ros2 launch the signal can come twice, the second must not end this."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    if node is not None:
        node.destroy_node()
    # The signal's own handler may be shutting down at this moment.
    with suppress(_ROS_ERROR):
        rclpy.try_shutdown()
