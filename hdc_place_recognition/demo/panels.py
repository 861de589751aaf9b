# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Building blocks of the demo world: textured parallelograms and pictures that face the camera.

World axes: x east, y north, z up, in meters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
from hdc_place_recognition.demo.canvas import Point
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Texture:
    """An image, (h, w, 3) BGR or (h, w, 4) BGRA, uint8, with cached minified versions."""

    pixels: NDArray[np.uint8]
    _levels: dict[tuple[int, int], NDArray[np.uint8]] = field(default_factory=dict, repr=False)

    def level(self, across: int, down: int) -> NDArray[np.uint8]:
        """Return the texture minified by 2**across and 2**down, at least 1 x 1 pixel."""
        if (across, down) not in self._levels:
            height, width = self.pixels.shape[:2]
            size = max(width >> across, 1), max(height >> down, 1)
            smaller = cv2.resize(self.pixels, size, interpolation=cv2.INTER_AREA)
            self._levels[across, down] = smaller.astype(np.uint8, copy=False)
        return self._levels[across, down]


@dataclass(frozen=True)
class Panel:
    """
    A textured parallelogram, visible from one side only.

    The columns of the (3, 3) matrix are the edge to the right, the edge downward and the top left
    corner: matrix @ (s, t, 1) with s and t in [0, 1] is a point of the panel.
    """

    matrix: NDArray[np.float64]
    texture: Texture

    @property
    def normal(self) -> NDArray[np.float64]:
        """Return the unit normal on the visible side, (3,)."""
        across, down = self.matrix[:, 0], self.matrix[:, 1]
        normal: NDArray[np.float64] = np.cross(down, across)
        return normal / float(np.linalg.norm(normal))


def upright(
    left: Sequence[float] | NDArray[np.float64],
    right: Sequence[float] | NDArray[np.float64],
    bottom: float,
    top: float,
    texture: Texture,
) -> Panel:
    """Return the vertical panel between two points of the plan, as seen from left to right."""
    across = right[0] - left[0], right[1] - left[1], 0.0
    columns = [across, (0.0, 0.0, bottom - top), (*left, top)]
    return Panel(np.array(columns, np.float64).T, texture)


@dataclass(frozen=True)
class Sprite:
    """An upright picture at a position, which always faces the camera; meters."""

    place: Point
    width: float
    height: float
    texture: Texture

    def facing(self, yaw: float) -> Panel:
        """Return the panel that a camera of this direction sees."""
        x, y = float(np.sin(yaw)) * self.width / 2, -float(np.cos(yaw)) * self.width / 2
        left, right = (
            (self.place[0] - x, self.place[1] - y),
            (self.place[0] + x, self.place[1] + y),
        )
        return upright(left, right, 0.0, self.height, self.texture)
