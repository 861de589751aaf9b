# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Image folders in the dataset format: images/, gt.npz, poses.csv."""

from __future__ import annotations

from collections.abc import Iterator
import csv
from dataclasses import dataclass
from pathlib import Path

from hdc_place_recognition.conversions.image import Bytes, image_from_message
from hdc_place_recognition.datasets.dataset import Stamps
from hdc_place_recognition.datasets.poses import Poses
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.results import Frame
import numpy as np
from numpy.typing import NDArray

SUFFIXES = ('.jpg', '.jpeg', '.png')
SECOND_NS = 10**9
_POSE_COLUMNS = ('x', 'y', 'z', 'qx', 'qy', 'qz', 'qw')


@dataclass(frozen=True)
class FolderImages:
    """
    The image files of a folder in sorted order; stamps are 0 s, 1 s, 2 s and so on.

    :param files: paths of the files.
    """

    files: tuple[Path, ...]

    @classmethod
    def from_folder(cls, folder: Path) -> FolderImages:
        """
        Return the jpg and png files of a folder.

        :raises PlaceRecognitionError: the folder has no image files.
        """
        files = tuple(sorted(file for file in folder.glob('*') if file.suffix.lower() in SUFFIXES))
        if not files:
            raise PlaceRecognitionError(f'{folder} holds no {", ".join(SUFFIXES)} files')
        return cls(files)

    def __len__(self) -> int:
        return len(self.files)

    def __iter__(self) -> Iterator[Frame]:
        """
        Yield the images with their stamps.

        :raises PlaceRecognitionError: a file cannot be decoded.
        """
        for stamp_ns, file in zip(self.stamps_ns.tolist(), self.files, strict=True):
            yield Frame(stamp_ns, read_image(file))

    @property
    def stamps_ns(self) -> Stamps:
        """Return (n,) int64, the stamps of all images in nanoseconds."""
        return np.arange(len(self.files), dtype=np.int64) * SECOND_NS


def read_image(file: Path) -> NDArray[np.uint8]:
    """
    Read an image file.

    :param file: jpg or png file, 8 or 16 bits per channel.
    :return: (h, w) uint8 gray or (h, w, 3) uint8 BGR.
    :raises PlaceRecognitionError: the file cannot be read or decoded.
    """
    try:
        return image_from_message(_Compressed(file.suffix.lower(), file.read_bytes()))
    except (OSError, PlaceRecognitionError) as error:
        raise PlaceRecognitionError(
            f'image {file}: {error}; replace it, or remove it with its row and column of the '
            'ground truth'
        ) from error


@dataclass
class _Compressed:
    """File content with the fields of sensor_msgs/CompressedImage, to decode it like a message."""

    format: str  # noqa: A003, RUF100 - the message's own name for it
    data: Bytes


def read_poses(file: Path) -> Poses:
    """
    Read a poses.csv file; the stamps are those of :class:`FolderImages`.

    :param file: csv file with the columns index (image number), x, y, z in meters and the
        quaternion qx, qy, qz, qw; further columns are ignored.
    :raises PlaceRecognitionError: a column is missing, or a value is not a number.
    """
    stamps, rows = [], []
    with file.open(newline='', encoding='utf-8') as stream:
        for number, row in enumerate(csv.DictReader(stream), start=2):
            try:
                stamps.append(int(row['index']) * SECOND_NS)
                rows.append([float(row[column]) for column in _POSE_COLUMNS])
            except (KeyError, TypeError, ValueError, csv.Error) as error:
                raise PlaceRecognitionError(
                    f'{file}, line {number}: {error!r}; every line needs numbers in the columns '
                    f'index, {", ".join(_POSE_COLUMNS)}'
                ) from error
    return Poses.from_rows(stamps, rows, str(file))
