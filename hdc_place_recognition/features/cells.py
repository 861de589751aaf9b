# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Dense cells: a second witness from the same network pass.

The hypervector of an image is compared first; it proposes keyframes. The grid of local features
that it was made of is kept once more, at 2 bits a number, and compared cell by cell. Two images of
one place agree on *where* their similar cells lie: one displacement explains most of them. The
similarity D of a pair (:func:`compare`) measures this agreement. D holds under seasons, where
keypoints fail, and orders what keypoints verify.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
from hdc_place_recognition.features.local_features import LocalFeatures
import numpy as np
from numpy.typing import NDArray

# Images that the mean of a grid position reaches back to; 400 were no better on four sets.
_MEAN_IMAGES = 100
# The mean of n images counts n / (n + 5): few images have no common content yet.
_MEAN_SHRINK = 5.0
# Levels and the limit of a 2-bit quantizer with least squared error for a normal distribution
# (J. Max, "Quantizing for minimum distortion", IRE Transactions on Information Theory, 1960).
_LOW_LEVEL, _HIGH_LEVEL, _LIMIT = 0.4528, 1.5104, 0.9816
_BITS = 2
_PER_BYTE = 8 // _BITS
# A position is static if this share of its energy, or less, is left without its mean. Measured:
# lowest share of moving content .46 (corridor), bumper and housing .02 to .25.
_STATIC_SHARE = 0.3
# Images after which a position can be found to be static.
_STATIC_IMAGES = 20
# Channels that deviate less than this within an image carry no information, only rounding.
_NOTHING = 1e-5
# Memory of the object and of the headers of its arrays.
_OBJECT_BYTES = 320

Grid = NDArray[np.float32]


def _levels() -> NDArray[np.float32]:
    """Return (256, 4) float32, the four numbers that a byte stands for."""
    codes = np.arange(256)[:, None] >> (_BITS * np.arange(_PER_BYTE)) & 3
    values = np.array([-_HIGH_LEVEL, -_LOW_LEVEL, _LOW_LEVEL, _HIGH_LEVEL], np.float32)
    return np.asarray(values[codes], np.float32)


_LEVELS = _levels()


@dataclass(frozen=True, slots=True)
class Cells:
    """
    The cells of one image in compact form: 28 bytes a cell at 112 channels.

    :param codes: (h * w, ceil(c / 4)) uint8, four numbers a byte, cells row by row.
    :param used: (ceil(h * w / 8),) uint8, packed bits: 0 for cells that do not count, because they
        are static or show nothing.
    :param rows: h.
    :param columns: w.
    :param channels: c.
    """

    codes: NDArray[np.uint8]
    used: NDArray[np.uint8]
    rows: int
    columns: int
    channels: int

    def __len__(self) -> int:
        return len(self.codes)

    @property
    def nbytes(self) -> int:
        """Bytes of memory held."""
        return _OBJECT_BYTES + self.codes.nbytes + self.used.nbytes

    def unpack(self) -> UnitCells:
        """Return the cells as unit vectors, for :func:`compare`."""
        values = np.take(_LEVELS, self.codes, axis=0)
        values = values.reshape(len(self.codes), _PER_BYTE * self.codes.shape[1])
        values = values[:, : self.channels]
        scales = 1 / np.sqrt(np.einsum('ij,ij->i', values, values))
        used = np.unpackbits(self.used, count=len(self.codes))
        values *= (scales * used)[:, None]
        return UnitCells(values, self.rows, self.columns, max(int(used.sum()), 1))


@dataclass(frozen=True, slots=True)
class UnitCells:
    """
    The cells of one image ready for comparison.

    :param vectors: (h * w, c) float32, unit length; zeros for cells that do not count.
    :param rows: h.
    :param columns: w.
    :param count: cells that count, at least 1.
    """

    vectors: NDArray[np.float32]
    rows: int
    columns: int
    count: int


@dataclass(frozen=True, slots=True)
class CellMatch:
    """
    How well the cells of two images agree.

    :param votes: summed cosines of mutually nearest cells at the best displacement, as a share
        of the cells.
    :param overlap: summed cosines of all overlapping cells at the best displacement, likewise.
    :param shift_x: how far to the right the content lies in the keyframe, cells.
    :param shift_y: how far down, cells.
    """

    votes: float
    overlap: float
    shift_x: int
    shift_y: int

    @property
    def similarity(self) -> float:
        """Return D, about .03 to .1 for different places and at most 2."""
        return self.votes + self.overlap


class CellEncoder:
    """
    Turns grids of local features into cells, relative to what all images have in common.

    Keeps a running mean of the standardized features at each grid position, and how much of the
    energy there remains without it. One object belongs to one camera. If the shape of the grid
    changes, the means are resampled.
    """

    def __init__(self) -> None:
        self._mean: NDArray[np.float32] = np.zeros((0, 0), np.float32)
        self._energy: NDArray[np.float32] = np.zeros(0, np.float32)
        self._rest: NDArray[np.float32] = np.zeros(0, np.float32)
        self._shape: tuple[int, ...] = ()
        self._seen = 0

    def update(self, grid: Grid) -> None:
        """
        Take an image into the running means; for each image that shows something new.

        :param grid: (h, w, c) float32.
        """
        features = _standardize(_flat(grid))
        self._follow(grid.shape)
        self._seen += 1
        rate = np.float32(max(1 / self._seen, 1 / _MEAN_IMAGES))
        rest = features - self._mean
        self._energy += (np.square(features).mean(axis=1) - self._energy) * rate
        self._rest += (np.square(rest).mean(axis=1) - self._rest) * rate
        self._mean += rest * rate

    def encode(self, grid: Grid) -> Cells:
        """
        Return the cells of an image; changes nothing.

        :param grid: (h, w, c) float32, local features on a regular grid.
        """
        features = _standardize(_flat(grid))
        if grid.shape == self._shape:
            share = np.float32(self._seen / (self._seen + _MEAN_SHRINK))
            features = _standardize(features - self._mean * share)
        rows, columns, channels = grid.shape
        used = ~self.static(grid.shape) & features.any(axis=1)
        return Cells(_quantize(features), np.packbits(used), rows, columns, channels)

    def static(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """
        Return (h * w,) bool: positions that show the same in otherwise different images.

        Captions, the robot's bumper, dirt on the lens. All False for another grid shape, and for
        a camera that never moved.
        """
        if shape != self._shape or self._seen < _STATIC_IMAGES:
            return np.zeros(shape[0] * shape[1], bool)
        static = self._rest < _STATIC_SHARE * self._energy
        return static if static.mean() <= 0.5 else np.zeros_like(static)

    def _follow(self, shape: tuple[int, ...]) -> None:
        """Resample the means to another grid; they begin anew for other features."""
        if shape == self._shape:
            return
        if self._seen and shape[2] == self._shape[2]:
            parts = (self._mean, self._energy, self._rest)
            self._mean, self._energy, self._rest = (
                _resampled(part, self._shape, shape) for part in parts
            )
        else:
            self._seen = 0
            self._mean = np.zeros((shape[0] * shape[1], shape[2]), np.float32)
            self._energy = np.zeros(shape[0] * shape[1], np.float32)
            self._rest = np.zeros(shape[0] * shape[1], np.float32)
        self._shape = shape


def _resampled(
    values: NDArray[np.float32], shape: tuple[int, ...], target: tuple[int, ...]
) -> NDArray[np.float32]:
    """Return values (h * w, ...) of a grid (h, w) at the cells of another one."""
    rows, columns, _ = target
    grid = values.reshape(shape[0], shape[1], -1)
    resized = cv2.resize(grid, (columns, rows), interpolation=cv2.INTER_LINEAR)
    return np.asarray(resized, np.float32).reshape(rows * columns, *values.shape[1:])


def as_grid(features: LocalFeatures) -> Grid | None:
    """Return (h, w, c) float32 if local features are a regular grid; None if they are not."""
    shape = features.grid_shape
    return None if shape is None else features.descriptors.reshape(*shape, -1)


def similarity(query: UnitCells, keyframe: Cells) -> float:
    """Return D of :func:`compare`, about .03 to .1 for different places and at most 2."""
    return compare(query, keyframe.unpack()).similarity


def compare(query: UnitCells, keyframe: UnitCells) -> CellMatch:
    """
    Compare two images cell by cell; grids of different shapes compare too.

    Mutually nearest cells (cosine) vote for their displacement, weighted by the cosine, in a
    window of 3 x 3. The overlap is the largest sum of cosines of all cells that lie on each other
    under a displacement within one cell of the peak. Both are shares of the smaller image's
    cells. About .3 ms for 15 x 20 cells on one core.
    """
    cosines = query.vectors @ keyframe.vectors.T
    votes = _votes(cosines, query, keyframe)
    peak_y, peak_x = np.unravel_index(int(votes.argmax()), votes.shape)
    overlap, shift_x, shift_y = max(
        (_overlap(cosines, query, keyframe, y, x), x, y)
        for y in range(int(peak_y) - query.rows, int(peak_y) - query.rows + 3)
        for x in range(int(peak_x) - query.columns, int(peak_x) - query.columns + 3)
    )
    count = min(query.count, keyframe.count)
    return CellMatch(float(votes.max()) / count, overlap / count, shift_x, shift_y)


def _votes(cosines: Grid, query: UnitCells, keyframe: UnitCells) -> NDArray[np.float64]:
    """Return (h + h2 - 1, w + w2 - 1) votes for displacements, windows of 3 x 3 summed."""
    nearest = cosines.argmax(axis=1)
    back = cosines.argmax(axis=0)
    first = np.flatnonzero(back[nearest] == np.arange(len(nearest)))
    second = nearest[first]
    y, x = np.divmod(first, query.columns)
    y2, x2 = np.divmod(second, keyframe.columns)
    shape = query.rows + keyframe.rows - 1, query.columns + keyframe.columns - 1
    bins = (y2 - y + query.rows - 1) * shape[1] + x2 - x + query.columns - 1
    weights = np.maximum(cosines[first, second], 0)
    votes = np.zeros((shape[0] + 2, shape[1] + 2))
    votes[1:-1, 1:-1] = np.bincount(bins, weights, shape[0] * shape[1]).reshape(shape)
    sums = votes[:-2] + votes[1:-1] + votes[2:]
    return np.asarray(sums[:, :-2] + sums[:, 1:-1] + sums[:, 2:])


def _overlap(
    cosines: Grid, query: UnitCells, keyframe: UnitCells, shift_y: int, shift_x: int
) -> float:
    """Return the sum of cosines of the cells that lie on each other under a displacement."""
    first_y, last_y = max(0, -shift_y), min(query.rows, keyframe.rows - shift_y)
    first_x, last_x = max(0, -shift_x), min(query.columns, keyframe.columns - shift_x)
    if first_y >= last_y or first_x >= last_x:
        return 0.0
    # Along x both indices rise by one, along y by one row of cells each: a strided view.
    width, item = cosines.shape[1], cosines.itemsize
    start = (first_y * query.columns + first_x) * width
    start += (first_y + shift_y) * keyframe.columns + first_x + shift_x
    view: Grid = np.ndarray(
        (last_y - first_y, last_x - first_x),
        cosines.dtype,
        cosines,
        start * item,
        ((query.columns * width + keyframe.columns) * item, (width + 1) * item),
    )
    return float(view.sum())


def _flat(grid: Grid) -> NDArray[np.float32]:
    """Return (h * w, c) float32."""
    return np.asarray(grid, np.float32).reshape(-1, grid.shape[-1])


def _standardize(features: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (k, c) float32 with mean 0 and deviation 1 in each channel of the image."""
    centered = features - features.mean(axis=0)
    deviations = np.sqrt(np.square(centered).mean(axis=0))
    scales = np.where(deviations > _NOTHING, deviations, np.float32(np.inf))
    return np.asarray(centered / scales, np.float32)


def _quantize(features: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return (k, ceil(c / 4)) uint8, the 2-bit codes of standardized features."""
    codes = (features > -_LIMIT).view(np.uint8) + (features > 0) + (features > _LIMIT)
    if codes.shape[1] % _PER_BYTE:
        codes = np.pad(codes, ((0, 0), (0, -codes.shape[1] % _PER_BYTE)))
    parts = (codes[:, part::_PER_BYTE] << np.uint8(_BITS * part) for part in range(_PER_BYTE))
    return np.asarray(np.bitwise_or.reduce(list(parts)), np.uint8)
