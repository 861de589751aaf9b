# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The fronts of the demo world's houses."""

from __future__ import annotations

from hdc_place_recognition.demo.canvas import Canvas, shaded
from hdc_place_recognition.demo.house import FLOOR_M, GROUND_FLOOR_M, House
from hdc_place_recognition.demo.shops import GROUND_FLOORS
from hdc_place_recognition.demo.walls import ROOFS, WALLS
from hdc_place_recognition.demo.windows import WINDOWS
import numpy as np

PIXELS_PER_METRE = 32.0


def front(house: House, rng: np.random.Generator) -> Canvas:
    """Return the painted front of a house, transparent beside its roof."""
    canvas = Canvas(house.width, house.height, PIXELS_PER_METRE, house.colour)
    WALLS[house.wall](canvas, house, rng)
    canvas.grain(3.5, rng)
    _rows_of_windows(canvas, house, rng)
    if rng.random() < 0.5:
        canvas.box(0.05, 0, 0.2, house.eaves, shaded(house.colour, 0.6))
    ROOFS[house.roof](canvas, house, rng)
    canvas.box(0, 0, house.width, 0.4, shaded(house.colour, 0.55))
    GROUND_FLOORS[house.ground_floor](canvas, house, rng)
    return canvas


def _rows_of_windows(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    bays = max(round(house.width / float(rng.uniform(2.0, 2.9))), 1)
    for floor in range(house.floors):
        y = GROUND_FLOOR_M + FLOOR_M * floor + 0.75
        for bay in range(bays):
            x = (bay + 0.5) * house.width / bays
            WINDOWS[house.windows](canvas, house.trim, x, y, rng)
