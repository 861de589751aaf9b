# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The ground floors of the demo world's houses: shops, cafes, entrances, garages, arcades."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from hdc_place_recognition.demo.canvas import Canvas, Color, DARK, GLASS, palette, shaded
from hdc_place_recognition.demo.house import GROUND_FLOOR_M, House
import numpy as np

CREAM: Color = (205, 225, 235)
GOODS = palette('c8463c e6b446 50aa5a 3c78be d7c8c8 96468c')


def _shop(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    """Paint a full-width shop window with goods, a door and a name board."""
    canvas.box(0.2, 0.1, house.width - 0.2, GROUND_FLOOR_M, shaded(house.accent, 0.7))
    door = float(rng.choice([0.5, house.width - 1.7]))
    _show_window(canvas, 0.5, house.width - 0.5, rng)
    _door(canvas, door, 1.2, shaded(house.accent, 0.5), rng)
    _name_board(canvas, house)


def _cafe(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    """Paint a door between two windows, below a striped awning."""
    middle = house.width / 2
    for left in (0.6, middle + 1.0):
        _show_window(canvas, left, left + middle - 1.6, rng)
    _door(canvas, middle - 0.6, 1.2, shaded(house.accent, 0.6), rng)
    stripes = round((house.width - 0.6) / 0.45)
    edges = np.linspace(0.3, house.width - 0.3, stripes + 1).tolist()
    for index, (left, right) in enumerate(pairwise(edges)):
        color = house.accent if index % 2 else CREAM
        canvas.box(left, 2.35, right, 3.1, color)
        canvas.disc((left + right) / 2, 2.35, (right - left) / 2, color)
    canvas.text(house.name, 0.5, 3.2, house.width - 0.5, 3.65, DARK)


def _entrance(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    """Paint a portal with steps, and barred windows beside it."""
    x = house.width * float(rng.choice([0.25, 0.5, 0.75]))
    for window in np.arange(1.2, house.width - 0.8, 2.4).tolist():
        canvas.box(window - 0.6, 1.2, window + 0.6, 2.8, house.trim)
        canvas.box(window - 0.5, 1.3, window + 0.5, 2.7, GLASS)
        for bar in np.linspace(window - 0.4, window + 0.4, 5).tolist():
            canvas.box(bar - 0.03, 1.3, bar + 0.03, 2.7, DARK)
    canvas.box(x - 1.2, 0, x + 1.2, 3.4, house.trim)
    canvas.disc(x, 2.6, 0.8, shaded(house.accent, 0.6))
    _door(canvas, x - 0.8, 1.6, house.accent, rng)
    canvas.box(x - 1.4, 0, x + 1.4, 0.18, (150, 155, 158))


def _garage(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    """Paint roller shutters, with graffiti."""
    count = max(round(house.width / 4), 1)
    for index in range(count):
        left = (index + 0.5) * house.width / count - 1.5
        canvas.box(left - 0.15, 0, left + 3.15, 3.1, DARK)
        for slat in np.arange(0.05, 2.8, 0.28).tolist():
            canvas.box(left, slat, left + 3, slat + 0.22, house.accent)
    x = float(rng.uniform(1.5, house.width - 1.5))
    for color in (GOODS[int(rng.integers(len(GOODS)))], CREAM):
        walk = np.cumsum(rng.normal(0, 0.4, (9, 2)), axis=0).clip(-1.3, 1.3) + np.array([x, 1.5])
        canvas.line(walk, 0.14, color)
    canvas.text(house.name, 0.5, 3.2, house.width - 0.5, 3.6, DARK)


def _arcade(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    """Paint dark arches on light pillars."""
    count = max(round(house.width / 2.6), 2)
    pitch = house.width / count
    canvas.box(0, 0, house.width, GROUND_FLOOR_M - 0.1, shaded(house.trim, 0.95))
    for index in range(count):
        x, radius = (index + 0.5) * pitch, pitch / 2 - 0.35
        canvas.box(x - radius, 0, x + radius, 2.2, (44, 40, 40))
        canvas.disc(x, 2.2, radius, (44, 40, 40))
        canvas.box(x - radius * 0.6, 0.5, x + radius * 0.6, 2.0, shaded(house.accent, 0.8))


def _market(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    """Paint crates of fruit before an open front, below a board across the house."""
    canvas.box(0.3, 0.3, house.width - 0.3, 3.0, (50, 60, 70))
    for row, bottom in enumerate((0.15, 0.65, 1.15)):
        for left in np.arange(0.4, house.width - 1.2, 0.95).tolist():
            canvas.box(left, bottom, left + 0.85, bottom + 0.4, (70, 110, 150))
            fruit = GOODS[int(rng.integers(len(GOODS)))]
            canvas.box(left + 0.06, bottom + 0.16, left + 0.79, bottom + 0.42, fruit)
        canvas.box(0.3, 1.7 + row * 0.4, house.width - 0.3, 1.75 + row * 0.4, (90, 110, 120))
    _name_board(canvas, house)


def _viaduct(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    """Paint one high arch of a railway viaduct, walled up far behind."""
    x, radius = house.width / 2, house.width / 2 - 0.9
    for grow, color in ((0.35, house.trim), (0.0, (58, 56, 60))):
        canvas.box(x - radius - grow, 0, x + radius + grow, 3.0, color)
        canvas.disc(x, 3.0, radius + grow, color, stretch=0.9)


def _show_window(canvas: Canvas, left: float, right: float, rng: np.random.Generator) -> None:
    canvas.box(left, 0.6, right, 2.7, (70, 62, 56))
    canvas.polygon([(left, 1.8), (left + 0.9, 2.7), (left, 2.7)], (150, 140, 125))
    for x in np.arange(left + 0.2, right - 0.6, 0.7).tolist():
        color = GOODS[int(rng.integers(len(GOODS)))]
        canvas.box(x, 0.65, x + 0.5, 0.65 + float(rng.uniform(0.3, 1.4)), color)
    canvas.box(left, 0.6, right, 2.7, CREAM, border=0.08)


def _door(
    canvas: Canvas, left: float, width: float, color: Color, rng: np.random.Generator
) -> None:
    canvas.box(left, 0.1, left + width, 2.6, color)
    canvas.box(left + 0.15, 1.2, left + width - 0.15, 2.4, GLASS)
    canvas.box(left, 0.1, left + width, 2.6, shaded(color, 0.5), border=0.08)


def _name_board(canvas: Canvas, house: House) -> None:
    canvas.box(0.1, 2.85, house.width - 0.1, 3.75, house.accent)
    bright = sum(house.accent) > 380
    canvas.text(house.name, 0.4, 3.05, house.width - 0.4, 3.55, DARK if bright else CREAM)


GROUND_FLOORS: dict[str, Callable[[Canvas, House, np.random.Generator], None]] = {
    'shop': _shop,
    'cafe': _cafe,
    'entrance': _entrance,
    'garage': _garage,
    'arcade': _arcade,
    'market': _market,
    'viaduct': _viaduct,
}
