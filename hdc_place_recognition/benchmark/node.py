# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The cost of the node from image to candidates, with parameter calls at the same time."""

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
    from hdc_place_recognition.benchmark.load_generator import LoadResult

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
    Yield latencies and counts of the node at several image sizes and rates.

    Without ROS or psutil the node is skipped.

    :raises PlaceRecognitionError: the node does not start.
    """
    for package in ('rclpy', 'psutil'):
        if find_spec(package) is None:
            _log.warning('%s is not installed: the node is skipped', package)
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
    from hdc_place_recognition.benchmark.load_generator import LoadGenerator
    from hdc_place_recognition.benchmark.node_process import LoadTask, node_process

    task, threads = LoadTask(_KEYFRAMES, settings.images, *size), settings.params.threads
    images = street(settings.images, *size)
    with node_process(task, settings.params) as process:
        generator = LoadGenerator(process.pid)
        try:
            generator.wait_for_node(lambda: process.poll() is None)
            for rate in rates:
                name = f'node, threads {threads}, {size[0]} x {size[1]}, {rate} Hz: '
                _log.info('measuring %s', name.rstrip(': '))
                target = _LATENCY_TARGETS.get((size, rate), '')
                yield from _report(name, generator.run(images, rate, _SECONDS), target)
        finally:
            generator.destroy_node()


def _report(name: str, result: LoadResult, latency_target: str) -> Iterator[Measurement]:
    yield from _quantiles(f'{name}latency', result.latencies_ms, (latency_target, ''))
    yield Measurement(f'{name}images sent', result.sent, '')
    yield Measurement(f'{name}images answered', result.answered, '')
    yield Measurement(f'{name}images dropped while busy', result.dropped, '')
    yield Measurement(f'{name}images skipped or refused', result.skipped, '')
    yield Measurement(f'{name}images lost by DDS', result.lost, '', target='0')
    yield Measurement(f'{name}images unaccounted for', result.unaccounted, '', target='0')
    yield Measurement(f'{name}CPU of the process', result.cpu, 'cores')
    yield from _quantiles(f'{name}parameter call', result.calls_ms, ('', _CALL_TARGET))


def _quantiles(
    name: str, spent_ms: NDArray[np.float64], targets: tuple[str, str]
) -> Iterator[Measurement]:
    """Yield median and 99 % quantile; nothing if there was no answer."""
    for share, words, target in zip((50, 99), ('median', '99 %'), targets, strict=True):
        if len(spent_ms):
            spent = float(np.percentile(spent_ms, share))
            yield Measurement(f'{name}, {words}', spent, 'ms', target=target)


def _set_up_ros() -> None:
    """
    Restrict ROS to this machine and enlarge the segment of Fast DDS, unless set otherwise.

    Both processes read the profile in `config/`. Without it Fast DDS loses most images of this
    size (doc/troubleshooting.md).
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
    """Return the profile of the source tree or the installation; None without one."""
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    shares = [Path(prefix, 'share', 'hdc_place_recognition') for prefix in prefixes]
    for folder in (Path(__file__).parents[2], *shares):
        if (file := folder / 'config' / 'large_images.xml').is_file():
            return file
    return None
