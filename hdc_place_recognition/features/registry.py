# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of extractors of local features."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features import keypoint
from hdc_place_recognition.features.efficientnet import EfficientNetLite0
from hdc_place_recognition.features.gradient_grid import GradientGrid
from hdc_place_recognition.features.local_features import Extractor


@dataclass(frozen=True)
class Settings:
    """What an extractor may depend on; each takes what concerns it."""

    image_width: int
    max_features: int
    threads: int
    pooled: bool


EXTRACTORS: dict[str, Callable[[Settings], Extractor]] = {
    'efficientnet_lite0': lambda settings: EfficientNetLite0(
        image_width=settings.image_width, threads=settings.threads, pooled=settings.pooled
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
    name: str, *, image_width: int, max_features: int, threads: int = 0, pooled: bool = False
) -> Extractor:
    """
    Return an extractor of the table.

    :param name: one of `EXTRACTORS`.
    :param image_width: larger images are reduced to this width first, pixels.
    :param max_features: features of an image at most; the dense ones keep their whole grid.
    :param threads: CPU threads of the network's runtime, 0 for its own choice.
    :param pooled: whether a network shall also give a vector of the whole image; the others have
        none.
    :raises PlaceRecognitionError: unknown name; what the extractor needs is missing or damaged.
    """
    if name not in EXTRACTORS:
        raise PlaceRecognitionError(
            f'unknown extractor {name!r}, choose one of {", ".join(EXTRACTORS)}'
        )
    return EXTRACTORS[name](Settings(image_width, max_features, threads, pooled))
