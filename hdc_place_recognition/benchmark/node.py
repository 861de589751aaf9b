# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The cost of the node end to end: images in, candidates out, parameters meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
import logging
import os
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from hdc_place_recognition.benchmark.images import street
from hdc_place_recognition.benchmark.settings import Settings
from hdc_place_recognition.benchmark.timing import Measurement
import numpy as np

if TYPE_CHECKING:
    from hdc_place_recognition.benchmark.node_user import Ride

_log = logging.getLogger(__name__)
_KEYFRAMES = 10_000
_SIZES, _RATES = ((640, 480), (1280, 720)), (10, 30)
_SECONDS = 8.0
_LATENCY_TARGETS = {(640, 480, 30): '<= 60 ms'}
_CALL_TARGET, _NONE_TARGET = '<= 50 ms', '0'
# Of diagnostics, in the order in which an image may meet them.
_COUNTS = ('lost by DDS', 'dropped while busy', 'refused', 'processed')


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
        for width, height in _SIZES:
            yield from _measure_size(settings, width, height)
    finally:
        rclpy.try_shutdown()


def _measure_size(settings: Settings, width: int, height: int) -> Iterator[Measurement]:
    from hdc_place_recognition.benchmark.node_process import Drive, node_process
    from hdc_place_recognition.benchmark.node_user import User

    drive = Drive(_KEYFRAMES, settings.images, width, height)
    images = street(settings.images, width, height)
    with node_process(drive) as process:
        user = User(process.pid)
        try:
            user.wait_for_node(lambda: process.poll() is None)
            for rate in _RATES:
                _log.info('showing the node %d x %d at %d Hz', width, height, rate)
                yield from _report(user.ride(images, rate, _SECONDS), (width, height, rate))
        finally:
            user.destroy_node()


def _report(ride: Ride, setting: tuple[int, int, int]) -> Iterator[Measurement]:
    name = 'node, {} x {}, {} Hz'.format(*setting)
    median, most = (float(np.percentile(ride.latencies_ms, share)) for share in (50, 99))
    target = _LATENCY_TARGETS.get(setting, '')
    yield Measurement(f'{name}: latency, median', median, 'ms', target=target)
    yield Measurement(f'{name}: latency, 99 %', most, 'ms')
    yield Measurement(f'{name}: images sent', ride.sent, '')
    yield Measurement(f'{name}: images answered', len(ride.latencies_ms), '')
    for what in _COUNTS:
        yield Measurement(f'{name}: images {what}', ride.counts[f'images {what}'], '')
    yield Measurement(f'{name}: images unaccounted for', ride.unaccounted, '', target=_NONE_TARGET)
    yield Measurement(f'{name}: CPU of the process', ride.cpu, 'cores')
    median, most = (float(np.percentile(ride.calls_ms, share)) for share in (50, 99))
    yield Measurement(f'{name}: parameter call, median', median, 'ms')
    yield Measurement(f'{name}: parameter call, 99 %', most, 'ms', target=_CALL_TARGET)


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
