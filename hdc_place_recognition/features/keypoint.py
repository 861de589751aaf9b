# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Features at detected keypoints: SIFT, RootSIFT and ORB of OpenCV."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import cv2
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.features.resize import as_gray, fit_width, Image, restore
import numpy as np
from numpy.typing import NDArray

Finish = Callable[[NDArray[Any]], NDArray[np.float32]]


class KeypointExtractor:
    """
    Describes the keypoints of the strongest response, strongest first.

    :param name: of the method.
    :param detector: OpenCV's detector and descriptor.
    :param finish: turns the detector's descriptors (k, n) into those of the method, (k, m).
    :param image_width: images are fitted to this width, pixels.
    :param max_features: k at most.
    """

    def __init__(
        self,
        name: str,
        detector: cv2.Feature2D,
        finish: Finish,
        *,
        image_width: int,
        max_features: int,
    ) -> None:
        self.identity = f'{name} image_width={image_width} max_features={max_features}'
        self._detector, self._finish = detector, finish
        self._image_width, self._max_features = image_width, max_features

    def extract(self, image: Image) -> LocalFeatures:
        """Return the features of a (h, w) gray or (h, w, 3) BGR image; k = 0 on a blank one."""
        gray = fit_width(as_gray(image), self._image_width)
        keypoints, descriptors = self._detect(gray)
        table = _table(keypoints)
        best = np.lexsort(table.T)[: self._max_features]
        angles, sizes, x, y, _ = table[best].astype(np.float32).T
        height, width = image.shape[:2]
        scale = np.float32(width / gray.shape[1])
        return LocalFeatures(
            keypoints=restore(np.stack([x, y], axis=1), gray, image),
            descriptors=self._finish(descriptors[best]),
            width=width,
            height=height,
            sizes=sizes * scale,
            angles=angles,
        )

    def _detect(self, gray: Image) -> tuple[Sequence[cv2.KeyPoint], NDArray[Any]]:
        """Return keypoints and descriptors, none instead of OpenCV's None and exceptions."""
        # ORB raises an exception if its pyramid cannot be built.
        if min(gray.shape) > 1:
            keypoints, descriptors = self._detector.detectAndCompute(gray, None)
            if descriptors is not None:
                return keypoints, np.asarray(descriptors)
        dtype = np.uint8 if self._detector.descriptorType() == cv2.CV_8U else np.float32
        return (), np.empty((0, self._detector.descriptorSize()), dtype)


def sift(*, image_width: int, max_features: int) -> KeypointExtractor:
    """Return D. Lowe's SIFT, 128-D."""
    return KeypointExtractor(
        'sift',
        cv2.SIFT.create(nfeatures=max_features),
        lambda histograms: histograms,
        image_width=image_width,
        max_features=max_features,
    )


def rootsift(*, image_width: int, max_features: int) -> KeypointExtractor:
    """Return RootSIFT of R. Arandjelovic and A. Zisserman (CVPR 2012), 128-D of unit length."""
    return KeypointExtractor(
        'rootsift',
        cv2.SIFT.create(nfeatures=max_features),
        root,
        image_width=image_width,
        max_features=max_features,
    )


def orb(*, image_width: int, max_features: int) -> KeypointExtractor:
    """Return ORB, its 256 bits as -1 and 1: their cosine is 1 - Hamming distance / 128."""
    return KeypointExtractor(
        'orb',
        cv2.ORB.create(nfeatures=max_features),
        signs,
        image_width=image_width,
        max_features=max_features,
    )


def root(histograms: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the square roots of histograms (k, m) of sum 1."""
    sums = histograms.sum(axis=1, keepdims=True)
    return np.sqrt(histograms / np.maximum(sums, np.finfo(np.float32).tiny))


def signs(bits: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return packed bits (k, m / 8) as (k, m) float32, -1 for 0 and 1 for 1."""
    return np.unpackbits(bits, axis=1).astype(np.float32) * 2 - 1


def _table(keypoints: Sequence[cv2.KeyPoint]) -> NDArray[np.float64]:
    """Return (k, 5): angle, size, x, y and weakness; sorted by the last, ties by those before."""
    rows = [(point.angle, point.size, *point.pt, -point.response) for point in keypoints]
    return np.array(rows, np.float64).reshape(-1, 5)
