# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The cost of encoding an image, against the projection of its features alone."""

from __future__ import annotations

from collections.abc import Iterator

from hdc_place_recognition.benchmark.settings import Settings
from hdc_place_recognition.benchmark.timing import Measurement, milliseconds
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.hdc.fast_bundling import bundle_folded, bundle_shifted
from hdc_place_recognition.hdc.image_descriptor import bundle_bound, DescriptorEncoder
from hdc_place_recognition.hdc.shifts import Shifts
from hdc_place_recognition.params.table import Params
import numpy as np

_WIDTH, _HEIGHT = 640, 480
_FEATURES, _LENGTH = 500, 128
# The grid of the default extractor at its default size.
_ROWS, _COLUMNS, _CHANNELS = 15, 20, 112


def measure_encoding(_: Settings) -> Iterator[Measurement]:
    """Yield the cost of one image: keypoints without and with shifts, and a grid with shifts."""
    rng = np.random.default_rng(0)
    yield from _measure_keypoints(rng)
    yield from _measure_grid(rng)


def _measure_keypoints(rng: np.random.Generator) -> Iterator[Measurement]:
    """Yield what keypoints cost: projected only, by Eq. 4 as it reads, folded, and shifted."""
    keypoints = (rng.random((_FEATURES, 2)) * (_WIDTH, _HEIGHT)).astype(np.float32)
    local = rng.standard_normal((_FEATURES, _LENGTH), np.float32)
    encoder = _encoder(Params().displacements_x)
    projection, shifts = encoder.projection(_LENGTH), encoder.shifts
    features = LocalFeatures(keypoints, local, _WIDTH, _HEIGHT)
    inputs = local, projection, encoder.positions, features
    size = f'{_FEATURES} x {_LENGTH}'
    alone = milliseconds(lambda: local @ projection.T)
    yield Measurement(f'projection alone, {size}', alone, 'ms')
    roles = encoder.positions.encode
    plain = milliseconds(lambda: bundle_bound(local, projection, roles(features)))
    yield Measurement(f'encoding as Eq. 4 reads, {size}', plain, 'ms', plain / alone, 'projection')
    folded = milliseconds(lambda: bundle_folded(*inputs))
    name = f'encoding folded, {size}'
    yield Measurement(name, folded, 'ms', folded / alone, 'projection', '<= 1.1')
    yield Measurement(name, folded, 'ms', folded / plain, 'Eq. 4', '<= 0.25')
    shifted = milliseconds(lambda: bundle_shifted(*inputs, shifts))
    count = len(shifts.offsets)
    name = f'encoding, {size}, {count} shifts'
    yield Measurement(name, shifted, 'ms', shifted / alone, 'projection')
    yield Measurement(name, shifted, 'ms', shifted / folded, 'folded', f'< {count}')


def _measure_grid(rng: np.random.Generator) -> Iterator[Measurement]:
    """Yield what the default extractor's features cost, against their projection alone."""
    encoder = _encoder(Params().displacements_x)
    x, y = np.meshgrid(np.arange(_COLUMNS) * 32, np.arange(_ROWS) * 32)
    keypoints = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)
    local = rng.standard_normal((len(keypoints), _CHANNELS), np.float32)
    features = LocalFeatures(keypoints, local, _WIDTH, _HEIGHT)
    projection = encoder.projection(_CHANNELS)
    size = f'{len(keypoints)} x {_CHANNELS}'
    alone = milliseconds(lambda: projection @ local.T)
    yield Measurement(f'projection alone, {size}', alone, 'ms')
    grid = milliseconds(lambda: encoder.encode(features))
    name = f'encoding a grid, {size}, {len(encoder.shifts.offsets)} shifts'
    yield Measurement(name, grid, 'ms', grid / alone, 'projection')


def _encoder(shifts: int) -> DescriptorEncoder:
    params = Params()
    return DescriptorEncoder(
        dimensions=params.dimensions,
        n_x=params.n_x,
        n_y=params.n_y,
        preprocessing=params.preprocessing,
        projection=params.projection,
        shifts=Shifts(shifts, shifts, params.displacement_step),
        seed=params.seed,
    )
