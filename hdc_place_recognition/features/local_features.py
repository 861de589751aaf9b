# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Local features, and what an extractor of them takes and gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class LocalFeatures:
    """
    The k local features of one image.

    :param keypoints: (k, 2) float32, pixels x right and y down, pixel centers at integers.
    :param descriptors: (k, m) float32, one row for each keypoint.
    :param width: of the image that the keypoints refer to, pixels.
    :param height: of the same image, pixels.
    :param sizes: (k,) float32, diameters in pixels, None where the method knows no scale.
    :param angles: (k,) float32, orientations in degrees, None likewise.
    """

    keypoints: NDArray[np.float32]
    descriptors: NDArray[np.float32]
    width: int
    height: int
    sizes: NDArray[np.float32] | None = None
    angles: NDArray[np.float32] | None = None

    def __len__(self) -> int:
        """Return the number of features k."""
        return len(self.keypoints)

    @property
    def grid_shape(self) -> tuple[int, int] | None:
        """Return (rows, columns) if the features are a regular grid, row by row; else None."""
        keypoints = self.keypoints
        if not len(keypoints):
            return None
        columns = int(np.argmax(keypoints[:, 1] != keypoints[0, 1])) or len(keypoints)
        if len(keypoints) % columns:
            return None
        x, y = keypoints[:columns, 0], keypoints[::columns, 1]
        regular = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return (len(y), columns) if np.array_equal(regular, keypoints) else None


class Extractor(Protocol):
    """A way to find and describe local features."""

    @property
    def identity(self) -> str:
        """Return method, settings and weights in words; equal words mean comparable features."""

    def extract(self, image: NDArray[np.uint8]) -> LocalFeatures:
        """
        Return the features of an image; k is 0 for an image without structure.

        :param image: (h, w) gray or (h, w, 3) BGR.
        """
