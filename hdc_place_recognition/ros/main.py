# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command place_recognition_node: how the node starts and ends."""

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


def main(
    argv: Sequence[str] | None = None,
    create: Callable[[], PlaceRecognitionNode] = PlaceRecognitionNode,
) -> int:
    """Run the node until it is interrupted; 2 if it cannot start, with one line that says why."""
    signal.signal(signal.SIGINT, _interrupt)
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


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Interrupt once: ros2 launch can send the signal twice, which must not abort the shutdown."""
    _on_signals(_do_nothing)
    raise KeyboardInterrupt


def _do_nothing(number: int, frame: FrameType | None) -> None:
    """Handle a signal that is already pending; SIG_IGN would make Python print an error."""


def _on_signals(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handler)


def _initialize(argv: Sequence[str] | None) -> None:
    """Start rclpy, without the log of its C library, which repeats what the exception says."""
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
    """Shut down without being interrupted."""
    # rclpy stops spinning at once; Python may hear of the same signal only now.
    with suppress(KeyboardInterrupt):
        _on_signals(_do_nothing)
    if node is not None:
        node.destroy_node()
    # The signal's own handler may be shutting down at this moment.
    with suppress(_ROS_ERROR):
        rclpy.try_shutdown()
    # Handlers written in Python do not outlast it.
    _on_signals(signal.SIG_IGN)
