# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Inference of an ONNX graph by onnxruntime if it is installed, otherwise by OpenCV."""

from __future__ import annotations

from collections.abc import Callable
import logging
import os

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
Inference = Callable[[Array], list[Array]]

_log = logging.getLogger(__name__)


def load(graph: bytes, outputs: list[str], threads: int) -> Inference:
    """
    Return a function that runs a graph: input array to list of output arrays.

    :param graph: serialized ONNX model with one input.
    :param outputs: names of the outputs.
    :param threads: CPU threads of onnxruntime, 0 for its default; at most the CPUs of the machine
        are used. OpenCV uses the number of threads of the process.
    """
    try:
        return with_onnxruntime(graph, outputs, threads)
    except ImportError as error:
        _log.info(
            'OpenCV runs the network, which takes three times as long as onnxruntime: %s', error
        )
        return with_opencv(graph, outputs)


def usable_threads(threads: int) -> int:
    """
    Return a number of threads that the process has CPUs for; log if it is smaller than asked.

    More threads than CPUs wait for each other: 16 threads on two CPUs take minutes per image.
    """
    available = len(os.sched_getaffinity(0))
    if threads > available:
        _log.warning(
            'threads %d is more than the %d CPUs that the process may use; %d are used',
            threads,
            available,
            available,
        )
    return min(threads, available)


def with_onnxruntime(graph: bytes, outputs: list[str], threads: int) -> Inference:
    """Return the function of :func:`load`, run by onnxruntime."""
    import onnxruntime

    # Nothing is collected, written or sent on behalf of the user.
    onnxruntime.disable_telemetry_events()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = usable_threads(threads)
    # Spinning threads use CPU time while they wait.
    options.add_session_config_entry('session.intra_op.allow_spinning', '0')
    session = onnxruntime.InferenceSession(graph, options, providers=['CPUExecutionProvider'])
    name = session.get_inputs()[0].name

    def run(tensor: Array) -> list[Array]:
        results: list[Array] = session.run(outputs, {name: tensor})
        return results

    return run


def with_opencv(graph: bytes, outputs: list[str]) -> Inference:
    """Return the function of :func:`load`, run by OpenCV."""
    network = cv2.dnn.readNetFromONNX(np.frombuffer(graph, np.uint8))

    def run(tensor: Array) -> list[Array]:
        network.setInput(tensor)
        return [np.asarray(output, np.float32) for output in network.forward(outputs)]

    return run
