# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Folders of images in the format of the data sets: images/, gt.npz, poses.csv."""

from __future__ import annotations

from collections.abc import Iterator
import csv
from dataclasses import dataclass
from pathlib import Path

from hdc_place_recognition.conversions.image import Bytes, image_from_message
from hdc_place_recognition.datasets.dataset import Frame, Stamps
from hdc_place_recognition.datasets.poses import Poses
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray

SUFFIXES = ('.jpg', '.jpeg', '.png')
SECOND_NS = 10**9
_POSE_COLUMNS = ('x', 'y', 'z', 'qx', 'qy', 'qz', 'qw')


@dataclass(frozen=True)
class FolderImages:
    """
    The image files of one folder in sorted order, stamped one second apart from 0 on.

    :param files: paths of the files.
    """

    files: tuple[Path, ...]

    @classmethod
    def from_folder(cls, folder: Path) -> FolderImages:
        """
        Return the jpg and png files of a folder.

        :raises PlaceRecognitionError: there are none.
        """
        files = tuple(sorted(file for file in folder.glob('*') if file.suffix.lower() in SUFFIXES))
        if not files:
            raise PlaceRecognitionError(f'{folder} holds no {", ".join(SUFFIXES)} files')
        return cls(files)

    def __len__(self) -> int:
        return len(self.files)

    def __iter__(self) -> Iterator[Frame]:
        """
        Yield stamp and image.

        :raises PlaceRecognitionError: a file does not decode; names it.
        """
        for stamp_ns, file in zip(self.stamps_ns.tolist(), self.files, strict=True):
            yield stamp_ns, read_image(file)

    @property
    def stamps_ns(self) -> Stamps:
        """Return (n,) int64, the stamps of all images."""
        return np.arange(len(self.files), dtype=np.int64) * SECOND_NS


def read_image(file: Path) -> NDArray[np.uint8]:
    """
    Return the image of a file: (h, w) if it is gray, else (h, w, 3) BGR; 16 bits become 8.

    :param file: a jpg or png file.
    :raises PlaceRecognitionError: it does not decode; names it.
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
    """A file's content in the fields of sensor_msgs/CompressedImage: decoded as messages are."""

    format: str  # noqa: A003, RUF100 - the message's own name for it
    data: Bytes


def read_poses(file: Path) -> Poses:
    """
    Return the poses of a poses.csv, stamped as the images of :class:`FolderImages`.

    :param file: csv with the columns index (of the image), x, y, z, qx, qy, qz, qw, and others.
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
