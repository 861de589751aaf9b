# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""How the node starts and ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
import signal
import sys
from types import FrameType

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.formats import NODE_NAME
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
# A signal ends the wait for callbacks by itself; this is the longest time if it does not.
_SPIN_S = 0.5


class _Stop:
    """
    A signal handler that notes that the node is to end.

    It raises no exception, which could interrupt a library anywhere, and takes no lock, since
    ros2 launch can send a signal twice.
    """

    requested = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        self.requested = True


def main(
    argv: Sequence[str] | None = None,
    create: Callable[[], PlaceRecognitionNode] = PlaceRecognitionNode,
) -> int:
    """Run the node until it is interrupted; 2 if it cannot start, with one line that says why."""
    stop, node = _Stop(), None
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    try:
        _initialize(argv)
        if not stop.requested:
            executor = SingleThreadedExecutor()
            node = create()
            _spin(executor, node, stop)
    except ExternalShutdownException:
        pass
    except Exception as error:
        # A signal shuts down the context, also while the node is being created.
        if not stop.requested:
            if not isinstance(error, _START_ERRORS):
                raise
            print(f'{NODE_NAME}: {" ".join(str(error).split())}', file=sys.stderr)
            return 2
    finally:
        _end(node)
    return 0


def _initialize(argv: Sequence[str] | None) -> None:
    """Start rclpy, without the log of its C library, which repeats what the exception says."""
    set_logger_level('rcl', LoggingSeverity.FATAL)
    rclpy.init(args=argv)
    set_logger_level('rcl', LoggingSeverity.UNSET)


def _spin(executor: SingleThreadedExecutor, node: PlaceRecognitionNode, stop: _Stop) -> None:
    """Spin until a signal arrives or the context is shut down."""
    executor.add_node(node)
    try:
        while rclpy.ok() and not stop.requested:
            executor.spin_once(timeout_sec=_SPIN_S)
    except _ROS_ERROR:
        # A signal between two waits leaves the executor with a context that has gone.
        if rclpy.ok():
            raise


def _end(node: PlaceRecognitionNode | None) -> None:
    """Shut down; the signal's own handler in rclpy may be doing so at this moment."""
    if node is not None:
        with suppress(_ROS_ERROR):
            node.destroy_node()
    with suppress(_ROS_ERROR):
        rclpy.try_shutdown()
    # Handlers written in Python do not outlast it.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
