# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Images and their local features, kept while many settings look at the same ones."""

from __future__ import annotations

from dataclasses import replace
import hashlib

from hdc_place_recognition.features.local_features import Extractor, LocalFeatures
from hdc_place_recognition.offline.dataset import Dataset, Frame, Frames
import numpy as np
from numpy.typing import NDArray

LIMIT_BYTES = 2**30  # of images, and as much again of features


class KeepingExtractor:
    """
    An extractor that looks at each image once.

    What does not fit any more is extracted every time: images are gone through in order, so that
    dropping the oldest would lose each just before it is needed.

    :param extractor: the real one.
    :param limit_bytes: of features kept.
    """

    def __init__(self, extractor: Extractor, limit_bytes: int = LIMIT_BYTES) -> None:
        self._extractor = extractor
        self._free_bytes = limit_bytes
        self._kept: dict[tuple[tuple[int, ...], bytes], LocalFeatures] = {}

    @property
    def identity(self) -> str:
        """Return the real extractor's: the features are its own."""
        return self._extractor.identity

    def extract(self, image: NDArray[np.uint8]) -> LocalFeatures:
        """Return the features of an image, known by its content."""
        key = image.shape, hashlib.sha1(np.ascontiguousarray(image).data).digest()
        found = self._kept.get(key)
        if found is None:
            found = self._extractor.extract(image)
            self._keep(key, found)
        return found

    def _keep(self, key: tuple[tuple[int, ...], bytes], features: LocalFeatures) -> None:
        arrays = (features.keypoints, features.descriptors, features.pooled)
        size = sum(array.nbytes for array in arrays if array is not None)
        if size <= self._free_bytes:
            self._free_bytes -= size
            self._kept[key] = features


def in_memory(dataset: Dataset) -> Dataset:
    """Return the same data set with its images decoded once, if they fit."""
    return replace(
        dataset,
        queries=_decoded(dataset.queries),
        reference=None if dataset.reference is None else _decoded(dataset.reference),
    )


def _decoded(frames: Frames, limit_bytes: int = LIMIT_BYTES) -> Frames:
    kept: list[Frame] = []
    for stamp_ns, image in frames:
        limit_bytes -= image.nbytes
        if limit_bytes < 0:
            return frames
        kept.append((stamp_ns, image))
    return kept
