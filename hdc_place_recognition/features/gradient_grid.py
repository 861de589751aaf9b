# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Dense histograms of gradient orientation on a regular grid.

In the manner of N. Dalal and B. Triggs, "Histograms of Oriented Gradients for Human Detection"
(CVPR 2005): orientations without a sign, since light and season turn edges round.
"""

from __future__ import annotations

import cv2
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.features.resize import as_gray, fit_width, grid, Image, restore
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

BINS = 8
CELL = 8
BLOCK = 4
STEP = 2
# Cells, in each direction, that a histogram is averaged over.
_BLUR = 3


class GradientGrid:
    """
    Describes each point of a grid by the histograms of the 4 x 4 cells of 8 x 8 pixels around it.

    Points are 16 pixels of the fitted image apart; those without any gradient are left out.

    :param image_width: images are fitted to this width, pixels.
    """

    def __init__(self, *, image_width: int) -> None:
        self.identity = f'gradient_grid bins={BINS} cell={CELL} image_width={image_width}'
        self._image_width = image_width

    def extract(self, image: Image) -> LocalFeatures:
        """Return the 128-D features of a (h, w) gray or (h, w, 3) BGR image, of unit length."""
        gray = fit_width(as_gray(image), self._image_width, multiple=CELL, smallest=CELL * BLOCK)
        blocks = sliding_window_view(cell_histograms(gray), (BLOCK, BLOCK), (0, 1))[::STEP, ::STEP]
        points = grid(blocks.shape[:2], step=CELL * STEP, first=CELL * BLOCK // 2)
        descriptors = blocks.reshape(len(points), -1)
        lengths = np.linalg.norm(descriptors, axis=1)
        seen = lengths > 0
        height, width = image.shape[:2]
        return LocalFeatures(
            keypoints=restore(points[seen], gray, image),
            descriptors=descriptors[seen] / lengths[seen, None],
            width=width,
            height=height,
        )


def cell_histograms(gray: Image) -> NDArray[np.float32]:
    """
    Return the histogram of gradient orientation around each cell of 8 x 8 pixels.

    :param gray: (h, w), both multiples of 8.
    :return: (h / 8, w / 8, 8) float32, not negative: the mean gradient of an orientation in bins
        of 22.5 degrees, bin 0 around that of vertical edges, bin 4 around that of horizontal ones.
    """
    size = (gray.shape[1] // CELL, gray.shape[0] // CELL)
    cells = [
        cv2.blur(cv2.resize(part, size, interpolation=cv2.INTER_AREA), (_BLUR, _BLUR))
        for part in oriented_gradients(gray)
    ]
    return np.stack(cells, axis=-1)


def oriented_gradients(gray: Image) -> NDArray[np.float32]:
    """
    Return the gradient's magnitude shared out between the two nearest orientations.

    :param gray: (h, w).
    :return: (8, h, w) float32; the sum over the bins is the magnitude.
    """
    x = cv2.Sobel(gray, cv2.CV_32F, 1, 0, ksize=1)
    y = cv2.Sobel(gray, cv2.CV_32F, 0, 1, ksize=1)
    # In older OpenCV the last digit of cv2.magnitude depends on where its result is in memory.
    magnitude = np.sqrt(x * x + y * y)
    # An edge has two opposite gradients: the second half turn is that of the first again.
    position = cv2.phase(x, y) * np.float32(BINS / np.pi)
    position[position >= BINS] -= BINS
    parts = np.stack([np.maximum(1 - np.abs(position - i), 0) for i in range(BINS + 1)])
    parts[0] += parts[BINS]
    return parts[:BINS] * magnitude
