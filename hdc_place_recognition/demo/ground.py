# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The ground of the block: sidewalks, streets with markings, shadows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hdc_place_recognition.demo.canvas import Canvas, Color, Point
from hdc_place_recognition.demo.light import Light
from hdc_place_recognition.demo.panels import Panel, Texture
from hdc_place_recognition.demo.plan import (
    along_streets,
    BAY_M,
    CANAL,
    EAST_M,
    NORTH_M,
    PARK,
    PARKING_M,
    ROAD_M,
    SIDE_STREET,
    SOUTH_M,
    WEST_M,
)
from hdc_place_recognition.demo.route import Route
from hdc_place_recognition.demo.shadows import shadow_map, Walls
import numpy as np
from numpy.typing import NDArray

PIXELS_PER_METER = 20
TILE_M = 6
SPOT_M = 0.9
SIDEWALK: Color = (150, 156, 160)
JOINT: Color = (128, 134, 138)
WATER: Color = (110, 96, 60)
GRASS: Color = (64, 118, 92)
CURB: Color = (182, 186, 188)
ASPHALT: Color = (92, 90, 88)
PAINT: Color = (225, 228, 230)
ZEBRA: Point = (-3, -17)


def ground(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return the unlit ground of the plan as an (h, w, 3) image, north up."""
    canvas = Canvas(EAST_M - WEST_M, NORTH_M - SOUTH_M, PIXELS_PER_METER, SIDEWALK)
    for x in np.arange(0, canvas.width, 0.8).tolist():
        canvas.box(x, 0, x + 0.05, canvas.height, JOINT)
    for y in np.arange(0, canvas.height, 0.8).tolist():
        canvas.box(0, y, canvas.width, y + 0.05, JOINT)
    loop = _loop()
    streets = [loop, _outline(SIDE_STREET)]
    for extra, color in ((0.4, CURB), (0.0, ASPHALT)):
        for street in streets:
            canvas.line(street, 2 * (ROAD_M + extra), color)
    canvas.polygon(_outline(PARK), GRASS)
    canvas.polygon(_outline(CANAL), WATER)
    _patches(canvas, loop, rng)
    _markings(canvas, loop)
    canvas.grain(5, rng)
    canvas.grain(4, rng, size=2.5)
    return canvas.bgr()


def _patches(canvas: Canvas, loop: Sequence[Point], rng: np.random.Generator) -> None:
    """Paint repaired asphalt and manhole covers."""
    for x, y in (loop[int(index)] for index in rng.integers(len(loop), size=45)):
        x, y = x + float(rng.uniform(-4, 4)), y + float(rng.uniform(-4, 4))
        if rng.random() < 0.4:
            canvas.disc(x, y, 0.35, (60, 60, 62))
            canvas.disc(x, y, 0.25, (84, 84, 86))
        else:
            gray = int(rng.integers(62, 120))
            wide, high = rng.uniform(0.4, 1.6, 2).tolist()
            canvas.box(x - wide, y - high, x + wide, y + high, (gray, gray, gray))


def _markings(canvas: Canvas, loop: Sequence[Point]) -> None:
    """Paint the dashed center line, the parking bays and a zebra crossing."""
    for start in range(0, len(loop), 8):
        canvas.line(loop[start:][:4], 0.15, PAINT)
    for bay in along_streets(PARKING_M, BAY_M):
        forward = np.array([np.cos(bay.yaw), np.sin(bay.yaw)]) * BAY_M / 2
        end = np.array(_local(bay.x, bay.y)) + forward
        across = np.array([-forward[1], forward[0]]) / BAY_M * 1.8
        canvas.line([end - across, end + across], 0.12, PAINT)
    x, y = _local(*ZEBRA)
    for stripe in np.arange(y - 4.5, y + 4.6).tolist():
        canvas.box(x - 1.6, stripe - 0.25, x + 1.6, stripe + 0.25, PAINT)


def lit_ground(
    plain: NDArray[np.uint8], walls: Walls, spots: NDArray[np.float64], light: Light
) -> Iterator[Panel]:
    """
    Return the ground as tiles, with the light and shadows of a time of day.

    :param plain: the unlit ground, from :func:`ground`.
    :param walls: walls that cast shadows.
    :param spots: (n, 2) positions of objects that darken the ground below them.
    :param light: the time of day.
    """
    shadow = shadow_map(
        _pixels(walls.shadows(light)), _pixels(spots), round(SPOT_M * PIXELS_PER_METER), plain
    )
    sun = np.array(light.on(np.array([0, 0, 1])), np.float32)
    shade = np.array(light.shade, np.float32)
    lit = plain * (sun + shadow[:, :, None] * (shade - sun))
    return _tiles(np.clip(lit, 0, 255).astype(np.uint8))


def _tiles(pixels: NDArray[np.uint8]) -> Iterator[Panel]:
    side = TILE_M * PIXELS_PER_METER
    for top in range(0, pixels.shape[0], side):
        for left in range(0, pixels.shape[1], side):
            tile = pixels[top:, left:][:side, :side]
            height, width = np.array(tile.shape[:2]) / PIXELS_PER_METER
            corner = WEST_M + left / PIXELS_PER_METER, NORTH_M - top / PIXELS_PER_METER, 0
            columns = np.array([(width, 0, 0), (0, -height, 0), corner], np.float64)
            yield Panel(columns.T, Texture(tile))


def _loop() -> list[Point]:
    """Return the path around the block, in meters of the map."""
    return [_local(moment.pose.x, moment.pose.y) for moment in Route(1.0).images()]


def _outline(points: Sequence[Point]) -> list[Point]:
    return [_local(x, y) for x, y in points]


def _local(x: float, y: float) -> Point:
    return x - WEST_M, y - SOUTH_M


def _pixels(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return the map pixels (x, y) of points (..., 2) of the plan."""
    pixels = (points - (WEST_M, NORTH_M)) * (1, -1) * PIXELS_PER_METER
    return np.rint(pixels).astype(np.int32)
