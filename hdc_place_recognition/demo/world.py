# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The demo world: a block of streets, rendered from any pose in the first or a later lap."""

from __future__ import annotations

import cv2
from hdc_place_recognition.demo.camera import Camera
from hdc_place_recognition.demo.light import Light, sky_before
from hdc_place_recognition.demo.raster import draw
from hdc_place_recognition.demo.route import Pose
from hdc_place_recognition.demo.scene import Block, Scene
import numpy as np
from numpy.typing import NDArray

CAMERA = Camera(width=320, height=240, field_of_view_deg=80.0, height_m=1.5, horizon=0.62)
SUPERSAMPLING = 2
MEAN_BRIGHTNESS = 105.0  # target of the exposure
EXPOSURE_EFFORT = 0.7  # share of the correction that is applied

MIDDAY = Light(
    azimuth=-60,
    elevation=52,
    sun=(0.42, 0.46, 0.48),
    shade=(0.64, 0.62, 0.60),
    zenith=(225, 170, 110),
    horizon=(240, 225, 205),
    cloudiness=-0.2,
)
EVENING = Light(
    azimuth=160,
    elevation=30,
    sun=(0.27, 0.40, 0.52),
    shade=(0.47, 0.46, 0.47),
    zenith=(190, 150, 125),
    horizon=(180, 205, 230),
    cloudiness=0.3,
)


class StreetWorld:
    """
    A block of streets; the same seed gives the same pixels.

    Lap 0 is at midday; later laps are in the evening, with different passers-by and parked cars.
    """

    def __init__(self, seed: int = 0) -> None:
        self._seed = seed
        self._block = Block.build(np.random.default_rng([seed, 0]))
        self._camera = CAMERA.magnified(SUPERSAMPLING)
        self._scenes: dict[int, Scene] = {}

    def render(self, pose: Pose, lap: int) -> NDArray[np.uint8]:
        """Return the image of the camera at a pose, (240, 320, 3) BGR."""
        scene = self._scene(lap)
        background = sky_before(self._camera, scene.sky, pose.yaw)
        panels = [*scene.panels, *(sprite.facing(pose.yaw) for sprite in scene.sprites)]
        large = draw(background, panels, self._camera, pose)
        size = CAMERA.width, CAMERA.height
        small = cv2.resize(large, size, interpolation=cv2.INTER_AREA)
        return _exposed(np.asarray(small, np.uint8))

    def _scene(self, lap: int) -> Scene:
        if lap not in self._scenes:
            light = MIDDAY if lap == 0 else EVENING
            rng = np.random.default_rng([self._seed, 1, lap])
            self._scenes[lap] = Scene.of(self._block, light, self._camera, rng)
        return self._scenes[lap]


def _exposed(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the image after automatic exposure."""
    gain = (MEAN_BRIGHTNESS / max(float(image.mean()), 1.0)) ** EXPOSURE_EFFORT
    return np.asarray(cv2.convertScaleAbs(image, alpha=gain), np.uint8)
