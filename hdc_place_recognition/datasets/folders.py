# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Image folders in the dataset format: images/, gt.npz, poses.csv."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import csv
from dataclasses import dataclass
from itertools import pairwise
import logging
import math
from pathlib import Path
import re

from hdc_place_recognition.bounded_files import MIB, read_bounded
from hdc_place_recognition.conversions.image import Bytes, ImageConverter
from hdc_place_recognition.conversions.image_size import SUFFIXES
from hdc_place_recognition.datasets.dataset import Stamps
from hdc_place_recognition.datasets.poses import Poses
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.results import Frame
import numpy as np
from numpy.typing import NDArray

SECOND_NS = 10**9
_log = logging.getLogger(__name__)
_NAMED = 3  # files that are left out are named up to this number
_IMAGE_BYTES = 512 * MIB
_POSES_BYTES = 16 * MIB
_LAST_INDEX = 10**9
_QUATERNION = ('qx', 'qy', 'qz', 'qw')


@dataclass(frozen=True)
class FolderImages:
    """
    The image files of a folder in natural order; stamps are 0 s, 1 s, 2 s and so on.

    :param files: paths of the files.
    :param max_pixels: images of more pixels are refused.
    :param oriented: turn images by their EXIF orientation.
    """

    files: tuple[Path, ...]
    max_pixels: int = Params.max_image_pixels
    oriented: bool = True

    @classmethod
    def from_folder(
        cls, folder: Path, max_pixels: int = Params.max_image_pixels, *, oriented: bool = True
    ) -> FolderImages:
        """
        Return the image files of a folder; log what is left out and an ambiguous order.

        Numbers in names are compared as numbers: 2.jpg comes before 10.jpg. Hidden files are left
        out; they hold attributes of other files.

        :raises PlaceRecognitionError: the folder has no image files.
        """
        entries = sorted(folder.glob('*'))
        files = [file for file in entries if _is_image(file)]
        _report_left_out(folder, [file for file in entries if not _is_image(file)])
        if not files:
            raise PlaceRecognitionError(
                f'{folder} holds no .jpg, .png or {_other_suffixes()} file'
            )
        _report_order(folder, files)
        return cls(tuple(sorted(files, key=_natural)), max_pixels, oriented)

    def __len__(self) -> int:
        return len(self.files)

    def __iter__(self) -> Iterator[Frame]:
        """
        Yield the images with their stamps.

        :raises PlaceRecognitionError: a file cannot be decoded.
        """
        converter = ImageConverter(self.max_pixels, oriented=self.oriented)
        for stamp_ns, file in zip(self.stamps_ns.tolist(), self.files, strict=True):
            yield Frame(stamp_ns, read_image(file, converter))

    @property
    def stamps_ns(self) -> Stamps:
        """Return (n,) int64, the stamps of all images in nanoseconds."""
        return np.arange(len(self.files), dtype=np.int64) * SECOND_NS


def read_image(file: Path, converter: ImageConverter | None = None) -> NDArray[np.uint8]:
    """
    Read an image file.

    :param file: file of a format in `SUFFIXES`, 8 or 16 bits per channel.
    :param converter: of the images of the same camera; None for a single image.
    :return: (h, w) uint8 gray or (h, w, 3) uint8 BGR.
    :raises PlaceRecognitionError: the file cannot be read or decoded.
    """
    converter = converter or ImageConverter(oriented=True)
    remedy = 'replace it, or remove it with its row and column of the ground truth'
    try:
        content = read_bounded(file, _IMAGE_BYTES, 'image')
        return converter.convert(_Compressed(file.suffix.lower(), content))
    except PlaceRecognitionError as error:
        raise PlaceRecognitionError(f'image {file}: {error}; {remedy}') from error


@dataclass
class _Compressed:
    """File content with the fields of sensor_msgs/CompressedImage, to decode it like a message."""

    format: str  # noqa: A003, RUF100 - the message's own name for it
    data: Bytes


def _is_image(file: Path) -> bool:
    # A pipe or a device could block the reader forever.
    return file.suffix.lower() in SUFFIXES and not file.name.startswith('.') and file.is_file()


def _other_suffixes() -> str:
    return ', '.join(suffix for suffix in SUFFIXES if suffix not in ('.jpg', '.png'))


def _natural(file: Path) -> tuple[list[str | int], str]:
    """Return the sort key of a file: text without case, numbers by value; then the name."""
    parts = re.split(r'(\d+)', file.name.casefold())
    return [_value(part) if number % 2 else part for number, part in enumerate(parts)], file.name


def _value(digits: str) -> int:
    # Python converts at most 4300 digits; file names have at most 255.
    return int(digits)


def _report_left_out(folder: Path, left_out: list[Path]) -> None:
    """Log the files of a folder that are not read."""
    hidden = [file for file in left_out if file.name.startswith('.')]
    shown = [file for file in left_out if file not in hidden]
    if hidden:
        _log.info('%s: left out %s', folder, _names(hidden, 'hidden file'))
    if shown:
        _log.warning(
            '%s: left out %s; read are regular files with the suffixes %s',
            folder,
            _names(shown, 'file'),
            ' '.join(SUFFIXES),
        )


def _names(files: list[Path], kind: str) -> str:
    names = ', '.join(file.name for file in files[:_NAMED])
    more = ', ...' if len(files) > _NAMED else ''
    return f'{len(files)} {kind}{"" if len(files) == 1 else "s"}: {names}{more}'


def _report_order(folder: Path, files: list[Path]) -> None:
    """Log if the order of the images may not be what the ground truth assumes."""
    ordered = sorted(files, key=_natural)
    for before, after in pairwise(ordered):
        if _natural(before)[0] == _natural(after)[0]:
            _log.warning(
                '%s: the order of %s and %s is ambiguous; rename one', folder, before.name,
                after.name,
            )  # fmt: skip
            break
    changed = [pair for pair in zip(ordered, sorted(files), strict=True) if pair[0] != pair[1]]
    if changed:
        first, by_name = changed[0]
        _log.warning(
            '%s: images are in the order of the numbers in their names, %s before %s; rows of '
            'gt.npz and poses.csv must be in this order',
            folder,
            first.name,
            by_name.name,
        )


def read_poses(file: Path) -> Poses:
    """
    Read a poses.csv file; the stamps are those of :class:`FolderImages`.

    :param file: csv file with the columns index (image number), x, y and optionally z in meters,
        and the quaternion qx, qy, qz, qw, or yaw in radians; further columns are ignored.
    :raises PlaceRecognitionError: the file cannot be read, a column is missing, or a value is not
        a number.
    """
    content = read_bounded(file, _POSES_BYTES, 'poses')
    stamps, rows = [], []
    try:
        lines = content.decode('utf-8-sig').splitlines()
        for row in csv.DictReader(lines, skipinitialspace=True):
            rows.append([*_position(row), *_orientation(row)])
            stamps.append(_index(row) * SECOND_NS)
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise PlaceRecognitionError(
            f'{file}, line {len(stamps) + 2}: {error!r}; every line needs numbers in the columns '
            f'index, x, y, z, {", ".join(_QUATERNION)}; z may be missing, and yaw may replace the '
            'quaternion'
        ) from error
    return Poses.from_rows(stamps, rows, str(file))


def has_yaw(file: Path) -> bool:
    """Return whether the orientations of a poses.csv file are yaws, so x points forward."""
    with file.open(encoding='utf-8-sig', errors='replace') as stream:
        columns = [column.strip() for column in stream.readline(4096).split(',')]
    return 'yaw' in columns and not set(_QUATERNION) <= set(columns)


def _index(row: Mapping[str, str]) -> int:
    index = int(row['index'])
    if not 0 <= index <= _LAST_INDEX:
        raise ValueError(f'index {index} is outside 0 to {_LAST_INDEX}')
    return index


def _position(row: Mapping[str, str]) -> list[float]:
    return [float(row['x']), float(row['y']), float(row.get('z') or 0.0)]


def _orientation(row: Mapping[str, str]) -> list[float]:
    """Return the quaternion x y z w."""
    if 'yaw' not in row or set(_QUATERNION) <= set(row):
        return [float(row[column]) for column in _QUATERNION]
    half = float(row['yaw']) / 2
    if not math.isfinite(half):
        return [math.nan] * 4
    return [0.0, 0.0, math.sin(half), math.cos(half)]
