# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The registry of extractors: their names, and how each is created."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features import keypoint
from hdc_place_recognition.features.efficientnet import EfficientNetLite0
from hdc_place_recognition.features.gradient_grid import GradientGrid
from hdc_place_recognition.features.local_features import Extractor


@dataclass(frozen=True)
class ExtractorSettings:
    """
    What an extractor can be told; each uses the settings that it has.

    :param image_width: larger images are reduced to this width first, pixels.
    :param max_features: number of keypoints at most; grids keep every cell.
    :param threads: CPU threads of the network's runtime, 0 for its own choice.
    """

    image_width: int
    max_features: int
    threads: int


EXTRACTORS: dict[str, Callable[[ExtractorSettings], Extractor]] = {
    'efficientnet_lite0': lambda settings: EfficientNetLite0(
        image_width=settings.image_width, threads=settings.threads
    ),
    'sift': lambda settings: keypoint.sift(
        image_width=settings.image_width, max_features=settings.max_features
    ),
    'rootsift': lambda settings: keypoint.rootsift(
        image_width=settings.image_width, max_features=settings.max_features
    ),
    'orb': lambda settings: keypoint.orb(
        image_width=settings.image_width, max_features=settings.max_features
    ),
    'gradient_grid': lambda settings: GradientGrid(image_width=settings.image_width),
}


def create_extractor(
    name: str, *, image_width: int, max_features: int, threads: int = 0
) -> Extractor:
    """
    Return an extractor by its name; the other arguments are :class:`ExtractorSettings`.

    :param name: a key of `EXTRACTORS`.
    :raises PlaceRecognitionError: the name is unknown, or the package or weights of the extractor
        are missing or damaged.
    """
    if name not in EXTRACTORS:
        raise PlaceRecognitionError(
            f'unknown extractor {name!r}, choose one of {", ".join(EXTRACTORS)}'
        )
    return EXTRACTORS[name](ExtractorSettings(image_width, max_features, threads))
