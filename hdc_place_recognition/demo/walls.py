# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The walls and roofs of the demo world's houses."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from hdc_place_recognition.demo.canvas import Canvas, DARK, GLASS, shaded
from hdc_place_recognition.demo.house import FLOOR_M, GROUND_FLOOR_M, House, ROOF_M
import numpy as np

Painter = Callable[[Canvas, House, np.random.Generator], None]


def _plaster(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    canvas.grain(5, rng, size=1.5)
    for floor in range(house.floors):
        y = GROUND_FLOOR_M + FLOOR_M * floor
        canvas.box(0, y, house.width, y + 0.18, house.trim)


def _bricks(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    rows, columns = round(house.eaves / 0.25), round(house.width / 0.5)
    for row in range(rows):
        for column in range(columns + 1):
            x, y = (column - 0.5 * (row % 2)) * 0.5, row * 0.25
            tint = shaded(house.color, float(rng.uniform(0.78, 1.15)))
            canvas.box(x + 0.04, y + 0.04, x + 0.5, y + 0.25, tint)


def _stones(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    for row in range(round(house.eaves / 0.6)):
        x, y = float(-rng.uniform(0, 1)), row * 0.6
        while x < house.width:
            length = float(rng.uniform(0.8, 1.5))
            tint = shaded(house.color, float(rng.uniform(0.85, 1.1)))
            canvas.box(x + 0.05, y + 0.05, x + length, y + 0.6, tint)
            x += length


def _timber(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    posts = np.linspace(0, house.width, round(house.width / 1.6) + 1)
    for floor in range(house.floors):
        y = GROUND_FLOOR_M + FLOOR_M * floor
        canvas.box(0, y, house.width, y + 0.3, DARK)
        for left, right in pairwise(posts):
            canvas.box(left - 0.1, y, left + 0.1, y + FLOOR_M, DARK)
            ends = (left, right) if rng.random() < 0.5 else (right, left)
            canvas.line([(ends[0], y), (ends[1], y + FLOOR_M)], 0.18, DARK)


def _cladding(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    for x in np.arange(0, house.width, 0.8):
        tint = shaded(house.color, float(rng.choice([0.75, 1.0, 1.2])))
        canvas.box(float(x), GROUND_FLOOR_M, float(x) + 0.76, house.eaves, tint)


def _parapet(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    canvas.box(0, house.eaves, house.width, house.height, shaded(house.color, 0.9))
    canvas.box(0, house.height - 0.3, house.width, house.height, house.trim)
    canvas.box(0, house.eaves - 0.1, house.width, house.eaves + 0.35, house.trim)


def _tiles(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    canvas.box(0, house.eaves, house.width, house.height, (62, 74, 142))
    for y in np.arange(house.eaves + 0.2, house.height, 0.3):
        canvas.box(0, float(y), house.width, float(y) + 0.08, (48, 56, 105))
    canvas.box(0, house.eaves - 0.15, house.width, house.eaves + 0.1, DARK)


def _mansard(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    canvas.box(0, house.eaves, house.width, house.height, (96, 84, 78))
    canvas.box(0, house.eaves - 0.25, house.width, house.eaves, house.trim)
    for x in np.arange(1.3, house.width - 0.8, 2.6):
        canvas.box(x - 0.55, house.eaves + 0.1, x + 0.55, house.height - 0.1, house.trim)
        canvas.box(x - 0.38, house.eaves + 0.25, x + 0.38, house.height - 0.35, GLASS)


def _crenels(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    canvas.pixels[: round(ROOF_M * canvas.scale)] = 0
    canvas.box(0, house.eaves - 0.3, house.width, house.eaves + 0.5, house.trim)
    for x in np.arange(0, house.width, 2.0):
        canvas.box(x, house.eaves, x + 1.0, house.height, house.trim)


def _gable(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    canvas.pixels[: round(ROOF_M * canvas.scale)] = 0
    middle, top = house.width / 2, house.height - 0.2
    canvas.polygon([(0, house.eaves), (house.width, house.eaves), (middle, top)], house.color)
    canvas.line([(0, house.eaves), (middle, top), (house.width, house.eaves)], 0.35, house.trim)
    canvas.disc(middle, house.eaves + 0.7, 0.5, house.trim)
    canvas.disc(middle, house.eaves + 0.7, 0.35, GLASS)


WALLS: dict[str, Painter] = {
    'plaster': _plaster,
    'bricks': _bricks,
    'stones': _stones,
    'timber': _timber,
    'cladding': _cladding,
}
ROOFS: dict[str, Painter] = {
    'parapet': _parapet,
    'tiles': _tiles,
    'mansard': _mansard,
    'crenels': _crenels,
    'gable': _gable,
}
