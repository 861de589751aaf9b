# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Shadows of the houses on the ground and on the fronts opposite."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
from hdc_place_recognition.demo.light import Light
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Walls:
    """Vertical walls: (n, 2) start and end points, (n,) heights; meters."""

    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    heights: NDArray[np.float64]

    def shadows(self, light: Light) -> NDArray[np.float64]:
        """Return the shadows of the walls on the ground as parallelograms, (n, 4, 2)."""
        reach = np.outer(self.heights, light.shadow)
        corners = [self.starts, self.ends, self.ends + reach, self.starts + reach]
        return np.stack(corners, axis=1)

    def shadow_height(self, foot: NDArray[np.float64], light: Light) -> float:
        """Return the height of the shadow above a (2,) point of the ground, in meters."""
        step = -light.shadow
        edges, offsets = self.ends - self.starts, self.starts - foot
        parallel = _cross(step, edges)
        parallel[np.abs(parallel) < 1e-9] = np.inf
        rise = _cross(offsets, edges) / parallel
        along = _cross(offsets, np.broadcast_to(step, offsets.shape)) / parallel
        hit = (rise > 0) & (along >= 0) & (along <= 1)
        return float(np.max(self.heights - rise, initial=0.0, where=hit))


def shadow_map(
    parallelograms: NDArray[np.int32],
    spots: NDArray[np.int32],
    radius: int,
    like: NDArray[np.uint8],
) -> NDArray[np.float32]:
    """Return a map of the size of `like`: 1 in the shadow, 0 in the sun, with soft borders."""
    mask = np.zeros(like.shape[:2], np.uint8)
    for parallelogram in parallelograms:
        cv2.fillConvexPoly(mask, parallelogram, (255,))
    for spot in spots.tolist():
        cv2.circle(mask, spot, radius, (255,), cv2.FILLED)
    return cv2.blur(mask, (9, 9)).astype(np.float32) / np.float32(255)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
