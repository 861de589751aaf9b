# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Two aligned traverses in one file: frames.npz, as of the Nordland railway."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from hdc_place_recognition.datasets.dataset import Dataset, Mode, Stamps
from hdc_place_recognition.datasets.folders import SECOND_NS
from hdc_place_recognition.datasets.ground_truth import AlignedTruth
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Value
from hdc_place_recognition.results import Frame
import numpy as np
from numpy.typing import NDArray

FILE = 'frames.npz'
# The images are those of a video, so keyframes are selected as on a robot.
_VIDEO: Mapping[str, Value] = {'min_interval_s': 0.0, 'exact': True}


@dataclass(frozen=True)
class ArrayImages:
    """
    Images in an array; stamps are 0 s, 1 s, 2 s and so on.

    :param images: (n, h, w) or (n, h, w, 3) uint8.
    """

    images: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.images)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the images with their stamps."""
        for stamp_ns, image in zip(self.stamps_ns.tolist(), self.images, strict=True):
            yield Frame(stamp_ns, image)

    @property
    def stamps_ns(self) -> Stamps:
        """Return (n,) int64, the stamps of all images in nanoseconds."""
        return np.arange(len(self.images), dtype=np.int64) * SECOND_NS


def open_arrays(name: str, file: Path) -> Dataset:
    """
    Open two traverses of the same number of images; images of one index show the same place.

    :param name: of the dataset.
    :param file: npz file with two uint8 arrays (n, h, w); the first is the map, the second holds
        the queries.
    :raises PlaceRecognitionError: the file cannot be read, or its arrays are different.
    """
    try:
        with np.load(file, allow_pickle=False) as arrays:
            reference, queries = (arrays[key] for key in arrays.files)
    except (OSError, ValueError) as error:
        raise PlaceRecognitionError(
            f'{file}: {error}; it needs two arrays of images, the map and the queries'
        ) from error
    if reference.shape != queries.shape or reference.ndim < 3 or reference.dtype != np.uint8:
        raise PlaceRecognitionError(
            f'{file}: the arrays are {reference.dtype} {reference.shape} and {queries.dtype} '
            f'{queries.shape}; both need to be uint8 of one shape (n, h, w)'
        )
    return Dataset(
        name,
        Mode.TRAVERSES,
        ArrayImages(queries),
        ArrayImages(reference),
        AlignedTruth(SECOND_NS),
        _VIDEO,
    )
