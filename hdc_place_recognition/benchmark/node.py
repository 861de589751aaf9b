# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The cost of the node end to end: images in, candidates out, parameters meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
import logging
import os
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from hdc_place_recognition.benchmark.images import street
from hdc_place_recognition.benchmark.settings import Settings
from hdc_place_recognition.benchmark.timing import Measurement
from hdc_place_recognition.params.table import Params
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from hdc_place_recognition.benchmark.node_user import Ride

_log = logging.getLogger(__name__)
_KEYFRAMES = 10_000
# Width and height, the node's threads, and rates in Hz.
_SETTINGS = (
    ((640, 480), Params.threads, (10, 30)),
    ((1280, 720), Params.threads, (10, 30)),
    ((640, 480), 1, (30,)),
)
_SECONDS = 8.0
_CALL_TARGET = '<= 50 ms'
_LATENCY_TARGETS = {((640, 480), 30): '<= 60 ms'}


def measure_node(settings: Settings) -> Iterator[Measurement]:
    """
    Yield what the node does with images of some sizes at some rates; skipped without ROS.

    :raises PlaceRecognitionError: the node does not start.
    """
    if find_spec('rclpy') is None:
        _log.info('rclpy is not installed: the node is skipped')
        return
    _set_up_ros()
    import rclpy

    rclpy.init(args=[])
    try:
        for size, threads, rates in _SETTINGS:
            params = settings.params.replace(threads=threads)
            yield from _measure_size(replace(settings, params=params), size, rates)
    finally:
        rclpy.try_shutdown()


def _measure_size(
    settings: Settings, size: tuple[int, int], rates: tuple[int, ...]
) -> Iterator[Measurement]:
    from hdc_place_recognition.benchmark.node_process import Drive, node_process
    from hdc_place_recognition.benchmark.node_user import User

    drive, threads = Drive(_KEYFRAMES, settings.images, *size), settings.params.threads
    images = street(settings.images, *size)
    with node_process(drive, settings.params) as process:
        user = User(process.pid)
        try:
            user.wait_for_node(lambda: process.poll() is None)
            for rate in rates:
                name = f'node, threads {threads}, {size[0]} x {size[1]}, {rate} Hz: '
                _log.info('measuring %s', name.rstrip(': '))
                target = _LATENCY_TARGETS.get((size, rate), '')
                yield from _report(name, user.ride(images, rate, _SECONDS), target)
        finally:
            user.destroy_node()


def _report(name: str, ride: Ride, latency_target: str) -> Iterator[Measurement]:
    yield from _quantiles(f'{name}latency', ride.latencies_ms, (latency_target, ''))
    yield Measurement(f'{name}images sent', ride.sent, '')
    yield Measurement(f'{name}images answered', ride.answered, '')
    yield Measurement(f'{name}images dropped while busy', ride.dropped, '')
    yield Measurement(f'{name}images passed over or refused', ride.passed_over, '')
    yield Measurement(f'{name}images lost by DDS', ride.lost, '', target='0')
    yield Measurement(f'{name}images unaccounted for', ride.unaccounted, '', target='0')
    yield Measurement(f'{name}CPU of the process', ride.cpu, 'cores')
    yield from _quantiles(f'{name}parameter call', ride.calls_ms, ('', _CALL_TARGET))


def _quantiles(
    name: str, spent_ms: NDArray[np.float64], targets: tuple[str, str]
) -> Iterator[Measurement]:
    """Yield median and 99 % of what there is; nothing if there was no answer at all."""
    for share, words, target in zip((50, 99), ('median', '99 %'), targets, strict=True):
        if len(spent_ms):
            spent = float(np.percentile(spent_ms, share))
            yield Measurement(f'{name}, {words}', spent, 'ms', target=target)


def _set_up_ros() -> None:
    """
    Keep to this machine, and to images that Fast DDS can carry, unless something else is set.

    Both processes read the profile of `config/`, as README advises: without it most images of
    this size are lost before any node sees them.
    """
    settings = {
        'AMENT_PREFIX_PATH': sys.prefix,
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': '88',
    }
    if (profile := _large_images_profile()) is not None:
        settings['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(profile)
    for name, value in settings.items():
        os.environ.setdefault(name, value)


def _large_images_profile() -> Path | None:
    """Return the file, of the source tree or as installed by colcon or pip; None without one."""
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    shares = [Path(prefix, 'share', 'hdc_place_recognition') for prefix in prefixes]
    for folder in (Path(__file__).parents[2], *shares):
        if (file := folder / 'config' / 'large_images.xml').is_file():
            return file
    return None
