# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
A renderer of textured panels with homographies, a depth buffer and minified textures.

The homography of a panel maps (s, t, 1) to pixels (x w, y w, w), where w is the depth in meters.
The last row of its inverse is therefore 1 / depth as a linear function of the pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
from hdc_place_recognition.demo.camera import Camera
from hdc_place_recognition.demo.panels import Panel, Texture
from hdc_place_recognition.demo.route import Pose
import numpy as np
from numpy.typing import NDArray

NEAR_M = 0.15
COARSEST_LEVEL = 5
SUBPIXEL_BITS = 4

# Homogeneous (s, t, 1) of the corners of a panel, in order around it, as columns.
CORNERS = np.array([[0, 1, 1, 0], [0, 0, 1, 1], [1, 1, 1, 1]], np.float64)


def draw(
    background: NDArray[np.uint8], panels: Sequence[Panel], camera: Camera, pose: Pose
) -> NDArray[np.uint8]:
    """Return the (h, w, 3) BGR image of the panels in front of the background."""
    canvas = _Canvas(background.copy(), np.zeros(background.shape[:2], np.float32))
    homographies = camera.project(np.stack([panel.matrix for panel in panels]), pose)
    for index in _visible_nearest_first(homographies, camera):
        canvas.paint(homographies[index], panels[index].texture)
    return canvas.image


def _visible_nearest_first(homographies: NDArray[np.float64], camera: Camera) -> list[int]:
    """Return the indices of the panels that face the camera and may be in view, nearest first."""
    x, y, w = np.moveaxis(homographies @ CORNERS, 1, 0)
    outside = (w < NEAR_M).all(1) | (x < 0).all(1) | (y < 0).all(1)
    outside |= (x > w * camera.width).all(1) | (y > w * camera.height).all(1)
    visible = np.flatnonzero(~outside & (np.linalg.det(homographies) > 1e-9))
    order: list[int] = visible[np.argsort(w[visible].mean(1))].tolist()
    return order


@dataclass(frozen=True)
class _Canvas:
    image: NDArray[np.uint8]
    nearness: NDArray[np.float32]  # 1 / depth, 0 = infinitely far

    def paint(self, homography: NDArray[np.float64], texture: Texture) -> None:
        """Paint a panel where it is nearer than the panels painted before."""
        polygon = _before_camera(homography)
        if len(polygon) < 3:
            return
        x, y, width, height = self._bounds(polygon)
        if width <= 0 or height <= 0:
            return
        inverse = np.linalg.inv(homography) @ _translation(x, y)
        region = slice(y, y + height), slice(x, x + width)
        nearness = _plane(inverse[2], width, height)
        mask = _filled(polygon - (x, y), width, height) & (nearness > self.nearness[region])
        if not mask.any():
            return
        colors = _warped(texture, inverse, width, height)
        if colors.shape[2] == 4:
            mask &= colors[:, :, 3] > 127
        np.copyto(self.nearness[region], nearness, where=mask)
        cv2.copyTo(np.ascontiguousarray(colors[:, :, :3]), mask.view(np.uint8), self.image[region])

    def _bounds(self, polygon: NDArray[np.float64]) -> tuple[int, int, int, int]:
        """Return left, top, width and height of the bounding box within the image."""
        height, width = self.nearness.shape
        left, top = np.clip(np.floor(polygon.min(0)), 0, (width, height)).astype(int).tolist()
        right, bottom = np.clip(np.ceil(polygon.max(0)) + 1, 0, (width, height)).astype(int)
        return left, top, int(right) - left, int(bottom) - top


def _before_camera(homography: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (n, 2) pixel corners of the panel, clipped at the near plane."""
    corners = (homography @ CORNERS).T
    clipped = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if start[2] >= NEAR_M:
            clipped.append(start)
        if (start[2] >= NEAR_M) != (end[2] >= NEAR_M):
            clipped.append(start + (end - start) * (NEAR_M - start[2]) / (end[2] - start[2]))
    points = np.array(clipped).reshape(-1, 3)
    return points[:, :2] / points[:, 2:]


def _filled(polygon: NDArray[np.float64], width: int, height: int) -> NDArray[np.bool_]:
    mask = np.zeros((height, width), np.uint8)
    points = np.rint(polygon * 2**SUBPIXEL_BITS).astype(np.int32)
    cv2.fillConvexPoly(mask, points, (1,), cv2.LINE_8, SUBPIXEL_BITS)
    return mask.view(np.bool_)


def _plane(row: NDArray[np.float64], width: int, height: int) -> NDArray[np.float32]:
    """Return row . (x, y, 1) at every pixel, (height, width)."""
    across = (row[0] * np.arange(width)).astype(np.float32)
    down = (row[1] * np.arange(height) + row[2]).astype(np.float32)
    return np.add.outer(down, across)


def _warped(
    texture: Texture, inverse: NDArray[np.float64], width: int, height: int
) -> NDArray[np.uint8]:
    """Return the texture as seen in a region, minified as the center of the region needs."""
    center = np.array([(width - 1) / 2, (height - 1) / 2, 1])
    s, t, w = inverse @ center
    rates = (inverse[:2, :2] * w - np.outer((s, t), inverse[2, :2])) / w**2
    size = np.array(texture.pixels.shape[1::-1])
    texels = np.hypot(*rates.T) * size
    across, down = np.clip(np.round(np.log2(texels + 1e-9)), 0, COARSEST_LEVEL).astype(int)
    pixels = texture.level(int(across), int(down))
    rows, columns = pixels.shape[:2]
    to_texels = np.array([[columns, 0, -0.5], [0, rows, -0.5], [0, 0, 1]]) @ inverse
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    warped = cv2.warpPerspective(
        pixels, to_texels, (width, height), flags=flags, borderMode=cv2.BORDER_REPLICATE
    )
    return warped.astype(np.uint8, copy=False)


def _translation(x: float, y: float) -> NDArray[np.float64]:
    return np.array([[1.0, 0, x], [0, 1, y], [0, 0, 1]])
