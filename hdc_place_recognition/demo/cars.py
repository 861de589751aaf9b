# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Parked cars: a profile, extruded to the width of the car."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from hdc_place_recognition.demo.canvas import (
    Canvas,
    Color,
    DARK,
    GLASS,
    outline,
    palette,
    Point,
    shaded,
)
from hdc_place_recognition.demo.panels import Panel, Texture
from hdc_place_recognition.demo.route import Pose
import numpy as np
from numpy.typing import NDArray

PIXELS_PER_METER = 40.0
WIDTH_M = 1.75
LENGTH_M = 4.3
HEIGHT_M = 2.0
PAINTS = palette('aa2828 285096 383a3c c8c8c8 ebebeb 3c783c dcaa32 6e7d82')
# From the front bumper over the roof to the rear bumper: meters from the rear, meters up.
SEDAN = outline('4.3,0.25 4.3,0.75 3.2,0.95 2.5,1.45 1.1,1.45 0.5,1.0 0,0.95 0,0.25')
VAN = outline('4.3,0.25 4.3,0.95 3.7,1.15 3.2,1.95 0.1,1.95 0.05,1.2 0,1.15 0,0.25')
WINDSHIELD, REAR_WINDOW, FRONT, REAR = 2, 4, 0, 6  # index of the strip between profile points


def car(pose: Pose, rng: np.random.Generator) -> Iterator[Panel]:
    """Yield the panels of a car of random paint and shape, centered at the pose."""
    profile = VAN if rng.random() < 0.25 else SEDAN
    paint = PAINTS[int(rng.integers(len(PAINTS)))]
    forward = np.array([np.cos(pose.yaw), np.sin(pose.yaw), 0])
    left = np.array([-forward[1], forward[0], 0])
    rear_right = np.array([pose.x, pose.y, 0]) - forward * LENGTH_M / 2 - left * WIDTH_M / 2
    side = _side(profile, paint).pixels
    length, height, width = forward * LENGTH_M, np.array([0, 0, HEIGHT_M]), left * WIDTH_M
    yield _panel(rear_right + height, length, -height, side)
    yield _panel(rear_right + width + length + height, -length, -height, side[:, ::-1])
    ends = [rear_right + forward * along + (0, 0, up) for along, up in profile]
    for index, (start, end) in enumerate(pairwise(ends)):
        strip = _strip(index, paint).pixels
        yield _panel(end, width, start - end, strip[::-1] if index == REAR else strip)


def _panel(
    corner: NDArray[np.float64],
    across: NDArray[np.float64],
    down: NDArray[np.float64],
    pixels: NDArray[np.uint8],
) -> Panel:
    return Panel(np.column_stack([across, down, corner]), Texture(pixels))


def _side(profile: Sequence[Point], paint: Color) -> Canvas:
    """Paint the right side of the car, with its front on the right."""
    canvas = Canvas(LENGTH_M, HEIGHT_M, PIXELS_PER_METER)
    canvas.polygon(profile, paint)
    (hood, sill), (front, roof), (rear, _), (trunk, _) = profile[2:6]
    canvas.polygon(
        [
            (hood - 0.15, sill),
            (front - 0.1, roof - 0.08),
            (rear + 0.1, roof - 0.08),
            (trunk + 0.2, sill + 0.02),
        ],
        GLASS,
    )
    for post in (rear + 0.1, (rear + front) / 2):
        canvas.box(post, 0.4, post + 0.08, roof, shaded(paint, 0.8))
    for wheel in (0.8, 3.5):
        canvas.disc(wheel, 0.33, 0.36, DARK)
        canvas.disc(wheel, 0.33, 0.2, (170, 170, 170))
    return canvas


def _strip(index: int, paint: Color) -> Canvas:
    """Paint a strip across the car: a window, a bumper with lights, or plain."""
    color = GLASS if index in (WINDSHIELD, REAR_WINDOW) else paint
    canvas = Canvas(WIDTH_M, 0.6, PIXELS_PER_METER, color)
    if index in (WINDSHIELD, REAR_WINDOW):
        canvas.box(0, 0, WIDTH_M, 0.6, paint, border=0.08)
    if index in (FRONT, REAR):
        light = (235, 240, 245) if index == FRONT else (40, 40, 200)
        canvas.box(0.1, 0.3, 0.45, 0.5, light)
        canvas.box(WIDTH_M - 0.45, 0.3, WIDTH_M - 0.1, 0.5, light)
        canvas.box(0.6, 0.1, 1.15, 0.22, (235, 235, 235))
        canvas.box(0.55, 0.35, 1.2, 0.5, DARK)
    return canvas
