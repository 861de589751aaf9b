# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Keypoints that belong to the camera or to the recording, not to a place.

Captions, time stamps, the bumper of a robot and dirt on the lens stay at the same pixels and look
the same in images that otherwise differ. Two rules find them. Both concern only matches that stay
at their pixels from one image to the other:

- Online: the symbol of a keypoint in table t (hdc/words.py) is bound to its cell in a grid of
  pixels, which is shifted at random for each table. The bundle of these pairs over all images is a
  table of counts. A keypoint is static if at least 3 of 8 tables have seen its pair often enough.
- For a pair of images: if most inliers stay at their pixels, either the camera stood at the same
  place, or something stays in front of it. Where there is no inlier, the dense cells of the two
  images agree without shift only if the place is the same.
"""

from __future__ import annotations

import cv2
from hdc_place_recognition.features.cells import UnitCells
from hdc_place_recognition.hdc.words import SYMBOLS
import numpy as np
from numpy.typing import NDArray

# A match that moves by less than 3 pixels of 320 stays at its pixels, widths of the image.
STILL = 3 / 320
# Static content is in at least this share of the images, and in two of them. The captions of one
# operator are in 2 to 4 % of the webcams of sped_thumbs_part1; keypoints of places are in less.
STATIC_SHARE, _LEAST_IMAGES = 0.02, 2
_TABLES, _TABLES_AGREE = 8, 3
# Cells along the width: 4 pixels of 320.
_COLUMNS = 80
_ROWS_AT_MOST = 2 * _COLUMNS
# An image of which a larger share of keypoints is where it was in the last one that was counted
# shows the same view.
_SAME_VIEW = 0.5
# Images after which all counts are halved.
_MEMORY = 250
_LEAST_CELLS = 10


class StaticContent:
    """
    Counts over the images of one camera which symbols stay at which pixels; 13 MB of memory.

    :param seed: of the grids' shifts.
    """

    def __init__(self, seed: int = 0) -> None:
        shape = (_TABLES, 2)
        self._shifts = np.random.default_rng(seed).uniform(0, 1, shape).astype(np.float32)
        cells = (_ROWS_AT_MOST + 1) * (_COLUMNS + 1)
        self._counts = np.zeros((_TABLES, SYMBOLS * cells), np.uint8)
        self._images = 0
        self._last: NDArray[np.int32] = np.empty((0, _TABLES), np.int32)

    @property
    def nbytes(self) -> int:
        """Return the bytes of memory held."""
        return self._counts.nbytes + self._last.nbytes

    def codes(self, symbols: NDArray[np.uint8], points: NDArray[np.float32]) -> NDArray[np.int32]:
        """
        Bind the symbols of keypoints to their positions.

        :param symbols: (k, 8, 2); the first of each pair is used.
        :param points: (k, 2), x and y in widths of the image.
        :return: (k, 8), indices of counts.
        """
        cells = np.floor(points[:, None] * _COLUMNS + self._shifts).astype(np.int32)
        x, y = cells[..., 0].clip(0, _COLUMNS), cells[..., 1].clip(0, _ROWS_AT_MOST)
        place = y * (_COLUMNS + 1) + x
        return np.asarray(place * SYMBOLS + symbols[:, :_TABLES, 0], np.int32)

    def static(self, codes: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Select the static ones of (k, 8) keypoints, by the images counted so far."""
        least = max(_LEAST_IMAGES, STATIC_SHARE * self._images)
        often = self._counts[np.arange(_TABLES), codes] >= least
        return np.asarray(often.sum(axis=1) >= _TABLES_AGREE)

    def count(self, codes: NDArray[np.int32]) -> bool:
        """
        Count an image that is no view of a place seen before.

        :param codes: (k, 8), of its keypoints.
        :return: whether it was counted; not if it shows the same view as the last one that was.
        """
        if not len(codes) or self._same_view(codes):
            return False
        for table in range(_TABLES):
            self._counts[table, np.unique(codes[:, table])] += 1
        self._last = codes
        self._images += 1
        if self._images >= _MEMORY:
            self._counts >>= 1
            self._images //= 2
        return True

    def _same_view(self, codes: NDArray[np.int32]) -> bool:
        if not len(self._last):
            return False
        same = [np.isin(codes[:, t], self._last[:, t]) for t in range(_TABLES)]
        return bool((np.sum(same, axis=0) >= _TABLES_AGREE).mean() > _SAME_VIEW)


def agreement_elsewhere(
    query: UnitCells, keyframe: UnitCells, points: NDArray[np.float32]
) -> float:
    """
    Return how much two images agree without shift, where no inlier is.

    :param query: cells of the query.
    :param keyframe: cells of the keyframe; the common part of both grids is compared.
    :param points: (n, 2), x and y of the inliers in the query, in widths of the image.
    :return: mean cosine; 1 if the inliers leave hardly any cell.
    """
    rows, columns = min(query.rows, keyframe.rows), min(query.columns, keyframe.columns)
    first, second = (
        cells.vectors.reshape(cells.rows, cells.columns, -1)[:rows, :columns]
        for cells in (query, keyframe)
    )
    cosines = np.einsum('yxc,yxc->yx', first, second)
    taken = np.zeros((rows, columns), np.uint8)
    at = (points * columns).astype(int)
    taken[at[:, 1].clip(0, rows - 1), at[:, 0].clip(0, columns - 1)] = 1
    rest = cv2.dilate(taken, np.ones((3, 3), np.uint8)) == 0
    return float(cosines[rest].mean()) if rest.sum() >= _LEAST_CELLS else 1.0
