# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""From an image to what it is compared and verified by."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
import logging

from hdc_place_recognition.features.cells import as_grid, Grid
from hdc_place_recognition.features.compact import CompactKeypoints, quantize
from hdc_place_recognition.features.local_features import Extractor
from hdc_place_recognition.hdc.algebra import Hypervector
from hdc_place_recognition.hdc.image_descriptor import DescriptorEncoder
from hdc_place_recognition.hdc.words import KEYPOINTS, WordHasher
from hdc_place_recognition.recognition.stopwatch import Stopwatch
import numpy as np
from numpy.typing import NDArray

_log = logging.getLogger(__name__)
_Keypoints = tuple[CompactKeypoints, NDArray[np.uint8]]


@dataclass(frozen=True)
class EncodedImage:
    """
    An image by itself, whatever came before it.

    :param vectors: (s, d) float32, the image descriptor under each shift; zeros without features.
    :param keypoints: for geometric verification, None without it.
    :param symbols: (k, 8, 2) uint8, symbols of the strongest keypoints; None without keypoints.
    :param grid: (h, w, c) float32, the local features, None if they are no grid.
    :param n_features: number of local features.
    """

    vectors: Hypervector
    keypoints: CompactKeypoints | None
    symbols: NDArray[np.uint8] | None
    grid: Grid | None
    n_features: int


class ImageEncoder:
    """
    Encodes images; the same image always gives the same result.

    :param extractor: of the local features that are bundled.
    :param descriptor: bundles them.
    :param keypoints: extractor of verification keypoints, None for no verification.
    :param hasher: turns keypoints into words.
    :param parallel: whether to extract the keypoints in a thread of their own. They share nothing
        with the network: a thread for each is faster than two threads for both, which wait for
        each other.
    """

    def __init__(
        self,
        extractor: Extractor,
        descriptor: DescriptorEncoder,
        keypoints: Extractor | None,
        hasher: WordHasher,
        *,
        parallel: bool,
    ) -> None:
        self._extractor, self._descriptor, self._keypoints = extractor, descriptor, keypoints
        self.hasher = hasher
        self._pool = ThreadPoolExecutor(1, 'keypoints') if keypoints and parallel else None
        self.identity = extractor.identity
        self._without_grid = False

    @property
    def verifies(self) -> bool:
        """Return whether images get keypoints for verification."""
        return self._keypoints is not None

    def encode(self, image: NDArray[np.uint8], watch: Stopwatch | None = None) -> EncodedImage:
        """
        Return an image encoded.

        :param image: (h, w) gray or (h, w, 3) BGR.
        :param watch: times the stages extract, encode and keypoints.
        """
        watch = watch or Stopwatch()
        get_keypoints = self._start_keypoints(image)
        with watch.stage('extract'):
            features = self._extractor.extract(image)
        with watch.stage('encode'):
            vectors = self._descriptor.encode(features)
        keypoints = symbols = None
        if get_keypoints is not None:
            with watch.stage('keypoints'):
                keypoints, symbols = get_keypoints()
        grid = as_grid(features)
        if grid is None and len(features):
            self._say_without_grid()
        return EncodedImage(vectors, keypoints, symbols, grid, len(features))

    def warm_up(self, width: int, height: int) -> None:
        """
        Do what only the first image of a size would have to wait for.

        This draws the random projection, plans the grid of positions, and makes the libraries set
        up what they set up on first use.
        """
        noise = np.random.default_rng(0).integers(0, 256, (height, width, 3), np.uint8)
        self.encode(noise)

    def _say_without_grid(self) -> None:
        """Log once that there are no dense cells."""
        if not self._without_grid:
            self._without_grid = True
            _log.info(
                'the features "%s" are no grid: candidates are not ordered by dense cells, and '
                'closures by appearance alone are not possible',
                self.identity,
            )

    def _start_keypoints(self, image: NDArray[np.uint8]) -> Callable[[], _Keypoints] | None:
        """Return a function that returns the keypoints: it extracts them, or waits for them."""
        if self._keypoints is None:
            return None
        extract = partial(_extract, self._keypoints, self.hasher, image)
        return self._pool.submit(extract).result if self._pool else extract


def _extract(extractor: Extractor, hasher: WordHasher, image: NDArray[np.uint8]) -> _Keypoints:
    """Return keypoints, and the symbols of the strongest."""
    keypoints = quantize(extractor.extract(image))
    return keypoints, hasher.symbols(keypoints.descriptors[:KEYPOINTS])
