# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What databases hold and what they say that they hold, full ones and one of a million images."""

from __future__ import annotations

from collections.abc import Iterator
import logging
from shutil import disk_usage
from tempfile import gettempdir

from hdc_place_recognition.benchmark.filling import fill_alone, FillResult, FillTask, PARTS
from hdc_place_recognition.benchmark.settings import Settings
from hdc_place_recognition.benchmark.timing import Measurement
from hdc_place_recognition.benchmark.vectors import DIMENSIONS
import numpy as np

_log = logging.getLogger(__name__)
_IMAGES = 100_000
# What is bounded: images, and those that are kept of them; megabytes.
_MANY, _KEPT, _MEGABYTES = 20_000, 5_000, 200.0
_MILLION, _QUERIES = 1_000_000, 40
_ALLOWED_MS, _ALLOWED_MB = 150, 700
_SLOWEST_US = 10_000
_TARGETS = {'median': '<= 1.2', 'maximum': '<= 1'}
_HONEST = '0.95 to 1.05'


def measure_memory(settings: Settings) -> Iterator[Measurement]:
    """Yield insertion and memory of a growing database, and of two that are full."""
    _log.info('adding %d images', _IMAGES)
    grown = fill_alone(FillTask(_IMAGES))
    yield from _insertions(grown)
    yield _promise(f'memory of {_IMAGES} images', grown)
    _log.info('adding %d images to full databases', _MANY)
    keypoints = fill_alone(FillTask(_KEPT, landmarks=True))
    yield _promise(f'memory of {_KEPT} images with keypoints', keypoints)
    few = fill_alone(FillTask(_MANY, landmarks=True, max_keyframes=_KEPT))
    yield from _bounded(f'max_keyframes {_KEPT}', few, few.images / _KEPT)
    small = fill_alone(FillTask(_MANY, landmarks=True, max_megabytes=_MEGABYTES))
    share = small.most_promised / 1e6 / _MEGABYTES
    yield from _bounded(f'max_database_mb {_MEGABYTES:g}', small, share)


def measure_million(settings: Settings) -> Iterator[Measurement]:
    """Yield what a query to a million vectors in a memory-mapped file costs."""
    folder = gettempdir()
    needed, free = _MILLION * DIMENSIONS * 2, disk_usage(folder).free
    if needed * 1.1 > free:
        _log.info('no room for %.1f GB in %s (set TMPDIR): skipped', needed / 1e9, folder)
        return
    _log.info('searching %d rows in %s', _MILLION, folder)
    filling = FillTask(_MILLION, row_type='float16', folder=folder, queries=_QUERIES)
    filled = fill_alone(filling)
    spent, rows = float(np.median(filled.queries_ms)), f'{_MILLION} rows'
    yield _allowed(f'two-stage query, 25 forms, {rows}', spent, 'ms', _ALLOWED_MS)
    yield _allowed(f'slowest of {_QUERIES}', max(filled.queries_ms), 'ms', _ALLOWED_MS)
    yield Measurement(f'two-stage place found, {rows}', filled.found, '', filled.found, 'all')
    yield _allowed(f'resident, {rows}', filled.resident / 1e6, 'MB', _ALLOWED_MB)
    yield _allowed(f'resident at most, {rows}', filled.peak / 1e6, 'MB', _ALLOWED_MB)
    yield Measurement(f'insertion, median, {rows}', float(np.median(filled.medians_us)), 'us')
    yield Measurement(f'insertion, maximum, {rows}', max(filled.maxima_us), 'us')


def _insertions(filled: FillResult) -> Iterator[Measurement]:
    """Yield the median and the slowest insertion of each part, to be drawn."""
    first = filled.medians_us[0]
    for index, spent in enumerate(zip(filled.medians_us, filled.maxima_us, strict=True)):
        until = (index + 1) * filled.images // PARTS
        for kind, value in zip(('median', 'maximum'), spent, strict=True):
            reference, unit = (first, 'first') if kind == 'median' else (_SLOWEST_US, '10 ms')
            name, target = f'insertion up to row {until}, {kind}', _TARGETS[kind]
            yield Measurement(name, value, 'us', value / reference, unit, target)


def _promise(name: str, filled: FillResult) -> Measurement:
    taken = filled.taken_by[-1]
    return Measurement(name, taken / 1e6, 'MB', taken / filled.promised, 'promised', _HONEST)


def _bounded(name: str, filled: FillResult, share: float) -> Iterator[Measurement]:
    yield Measurement(f'{name}: kept of {_MANY}', filled.images, '', share, 'limit', '<= 1')
    yield Measurement(f'{name}: forgotten', filled.forgotten, '')
    yield _promise(f'{name}: memory', filled)
    half = filled.taken_by[PARTS // 2 - 1]
    ratio = filled.taken_by[-1] / half
    yield Measurement(f'{name}: memory since half', half / 1e6, 'MB', ratio, 'half', _HONEST)


def _allowed(name: str, value: float, unit: str, limit: float) -> Measurement:
    return Measurement(name, value, unit, value / limit, f'{limit:g} {unit}', '<= 1')
