# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The light of a time of day: position of the sun, colors of sun, shade and sky."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
from hdc_place_recognition.demo.camera import Camera
from hdc_place_recognition.demo.canvas import Color
import numpy as np
from numpy.typing import NDArray

SKY_COLUMNS = 2048  # around the horizon
CLOUD_OCTAVES = ((8, 1.0), (16, 0.5), (32, 0.25), (64, 0.12))  # cells around the horizon, strength
Tint = tuple[float, float, float]  # factors of blue, green and red


@dataclass(frozen=True)
class Light:
    """Light of a time of day; angles in degrees, azimuth counterclockwise from east."""

    azimuth: float
    elevation: float
    sun: Tint
    shade: Tint
    zenith: Color
    horizon: Color
    cloudiness: float

    @property
    def toward_sun(self) -> NDArray[np.float64]:
        """Return the unit vector toward the sun, (3,)."""
        azimuth, elevation = np.radians([self.azimuth, self.elevation])
        level = np.cos(elevation)
        return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])

    @property
    def shadow(self) -> NDArray[np.float64]:
        """Return the offset of the shadow of a point one meter above the ground, (2,) meters."""
        sun = self.toward_sun
        return np.asarray(-sun[:2] / sun[2])

    def on(self, normal: NDArray[np.float64]) -> Tint:
        """Return the tint of a sunlit surface with this unit normal."""
        facing = max(float(self.toward_sun @ normal), 0.0)
        blue, green, red = (s + facing * t for s, t in zip(self.shade, self.sun, strict=True))
        return blue, green, red

    def sky(self, camera: Camera, rng: np.random.Generator) -> NDArray[np.uint8]:
        """Return the whole sky, (camera.height, SKY_COLUMNS, 3) BGR, from east to north."""
        rows = np.arange(camera.height)[:, None, None]
        up = np.clip(1 - rows / (camera.horizon * camera.height), 0, 1)
        colors = self.horizon + up * np.subtract(self.zenith, self.horizon)
        clouds = np.clip(_clouds(camera.height, rng) + self.cloudiness, 0, 1)[:, :, None]
        opacity = 0.6 * clouds * np.minimum(4 * up, 1)
        white = np.multiply(self.shade, 130) + np.multiply(self.sun, 150)
        return np.clip(colors + opacity * (white - colors), 0, 255).astype(np.uint8)


def tinted(pixels: NDArray[np.uint8], tint: Tint) -> NDArray[np.uint8]:
    """Return (h, w, 3 or 4) pixels with their colors multiplied by the tint."""
    factors = np.array([*tint, 1.0], np.float32)[: pixels.shape[2]]
    return np.clip(pixels * factors, 0, 255).astype(np.uint8)


def sky_before(camera: Camera, sky: NDArray[np.uint8], yaw: float) -> NDArray[np.uint8]:
    """Return the part of the sky (h, w, 3) that a camera of this direction sees."""
    x = np.arange(camera.width) - (camera.width - 1) / 2
    azimuth = yaw - np.arctan(x / camera.focal_px)
    columns = np.floor(azimuth / (2 * np.pi) * SKY_COLUMNS).astype(np.intp) % SKY_COLUMNS
    return np.ascontiguousarray(sky[:, columns])


def _clouds(height: int, rng: np.random.Generator) -> NDArray[np.float32]:
    clouds = np.zeros((height, SKY_COLUMNS), np.float32)
    for cells, strength in CLOUD_OCTAVES:
        noise = rng.normal(0, strength, (cells, cells)).astype(np.float32)
        closed = np.hstack([noise, noise[:, :1]])
        clouds += cv2.resize(closed, (SKY_COLUMNS, height))
    return clouds
