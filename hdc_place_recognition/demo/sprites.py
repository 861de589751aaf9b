# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of objects that look the same from all sides: trees, lamps, people."""

from __future__ import annotations

from collections.abc import Callable

from hdc_place_recognition.demo.canvas import Canvas, Color, DARK, palette, shaded
import numpy as np

PIXELS_PER_METER = 40.0
CLOTHES = palette('2d323c 32468c a03232 467846 c3bebe c8a03c 784678 3c6e6e')
LEAVES = palette('426e34 6e823c 305c30 b46e28')


def _tree(width: float, height: float, crown: float, rng: np.random.Generator) -> Canvas:
    """Paint a tree whose crown of leaves begins at `crown` meters."""
    canvas = Canvas(width, height, PIXELS_PER_METER)
    middle, radius, rise = width / 2, width / 2 - 0.4, (height - crown) / 2 - 0.3
    canvas.polygon(
        [
            (middle - 0.2, 0),
            (middle + 0.2, 0),
            (middle + 0.1, crown + 1),
            (middle - 0.1, crown + 1),
        ],
        (50, 66, 84),
    )
    leaves = LEAVES[int(rng.integers(len(LEAVES)))]
    for step in range(140):
        angle, away = float(rng.uniform(0, 2 * np.pi)), float(np.sqrt(rng.random()))
        x = middle + radius * away * np.cos(angle)
        y = crown + rise + 0.2 + rise * away * np.sin(angle)
        light = 0.6 + 0.5 * step / 140 + 0.25 * (y - crown) / height
        canvas.disc(float(x), float(y), float(rng.uniform(0.2, 0.4)), shaded(leaves, light))
    return canvas


def _round_tree(rng: np.random.Generator) -> Canvas:
    return _tree(float(rng.uniform(3.4, 4.6)), float(rng.uniform(5.0, 6.5)), 2.2, rng)


def _poplar(rng: np.random.Generator) -> Canvas:
    return _tree(2.2, float(rng.uniform(7.5, 9.5)), 1.4, rng)


def _lamp(rng: np.random.Generator) -> Canvas:
    canvas = Canvas(1.2, 5.0, PIXELS_PER_METER)
    canvas.box(0.53, 0, 0.67, 4.4, DARK)
    canvas.box(0.45, 0, 0.75, 0.7, DARK)
    canvas.polygon([(0.3, 4.3), (0.9, 4.3), (1.05, 4.75), (0.15, 4.75)], (200, 225, 235))
    canvas.box(0.15, 4.7, 1.05, 4.85, DARK)
    return canvas


def _advertising_column(rng: np.random.Generator) -> Canvas:
    canvas = Canvas(1.5, 3.3, PIXELS_PER_METER)
    canvas.box(0.1, 0, 1.4, 2.9, (70, 90, 60))
    for bottom in (0.5, 1.3, 2.1):
        poster: Color = tuple(rng.integers(60, 240, 3).tolist())
        canvas.box(0.1, bottom, 1.4, bottom + 0.75, poster)
        canvas.disc(float(rng.uniform(0.4, 1.1)), bottom + 0.4, 0.25, shaded(poster, 0.5))
    canvas.box(0, 2.85, 1.5, 3.0, DARK)
    canvas.disc(0.75, 2.95, 0.5, (70, 90, 60), stretch=0.6)
    return canvas


def _letter_box(rng: np.random.Generator) -> Canvas:
    canvas = Canvas(0.7, 1.5, PIXELS_PER_METER)
    color: Color = ((40, 200, 240), (50, 50, 200))[int(rng.integers(2))]
    canvas.box(0.25, 0, 0.45, 0.6, DARK)
    canvas.box(0.05, 0.5, 0.65, 1.4, color)
    canvas.box(0.15, 1.15, 0.55, 1.22, DARK)
    return canvas


def _road_sign(rng: np.random.Generator) -> Canvas:
    canvas = Canvas(0.8, 2.9, PIXELS_PER_METER)
    canvas.box(0.36, 0, 0.44, 2.5, (130, 130, 130))
    if rng.random() < 0.5:
        canvas.disc(0.4, 2.45, 0.38, (40, 40, 200))
        canvas.disc(0.4, 2.45, 0.26, (235, 235, 235))
    else:
        canvas.box(0.05, 2.1, 0.75, 2.8, (180, 90, 30))
        canvas.text('P', 0.15, 2.2, 0.65, 2.7, (240, 240, 240))
    return canvas


def _bush(rng: np.random.Generator) -> Canvas:
    canvas = Canvas(1.8, 1.5, PIXELS_PER_METER)
    canvas.box(0.3, 0, 1.5, 0.55, (70, 90, 150))
    for _ in range(50):
        x, y = float(rng.uniform(0.35, 1.45)), float(rng.uniform(0.6, 1.15))
        flower = rng.random() < 0.25
        color = (120, 90, 220) if flower else shaded(LEAVES[0], float(rng.uniform(0.7, 1.4)))
        canvas.disc(x, y, 0.1 if flower else 0.22, color)
    return canvas


def _church_tower(rng: np.random.Generator) -> Canvas:
    canvas = Canvas(7.0, 34.0, 24.0)
    canvas.box(0.5, 0, 6.5, 21, (150, 168, 178))
    for y in np.arange(0, 21, 0.7).tolist():
        canvas.box(0.5, y, 6.5, y + 0.08, (128, 146, 156))
    canvas.polygon([(0, 21), (7, 21), (3.5, 33.5)], (110, 130, 80))
    canvas.disc(3.5, 18, 1.7, (235, 235, 235))
    canvas.line([(3.5, 19.2), (3.5, 18), (4.4, 17.4)], 0.2, DARK)
    for x in (2.0, 5.0):
        canvas.box(x - 0.6, 9, x + 0.6, 13, DARK)
        canvas.disc(x, 13, 0.6, DARK)
    return canvas


def _chimney(rng: np.random.Generator) -> Canvas:
    canvas = Canvas(4.0, 36.0, 24.0)
    canvas.polygon([(0.3, 0), (3.7, 0), (2.9, 35), (1.1, 35)], (80, 96, 160))
    for y in (22, 27, 32):
        canvas.box(0.9, y, 3.1, y + 2, (225, 225, 230))
    return canvas


def person(rng: np.random.Generator) -> Canvas:
    """Return a painted passer-by."""
    canvas = Canvas(0.9, 1.85, PIXELS_PER_METER)
    top, legs = (CLOTHES[int(rng.integers(len(CLOTHES)))] for _ in range(2))
    stride = float(rng.uniform(0.05, 0.25))
    for foot in (-stride, stride):
        canvas.line([(0.45, 0.85), (0.45 + foot, 0.05)], 0.17, shaded(legs, 0.7))
    canvas.polygon([(0.25, 0.75), (0.65, 0.75), (0.68, 1.5), (0.22, 1.5)], top)
    canvas.line([(0.25, 1.42), (0.15, 0.85)], 0.12, shaded(top, 0.8))
    canvas.line([(0.65, 1.42), (0.75, 0.85)], 0.12, shaded(top, 0.8))
    canvas.disc(0.45, 1.68, 0.13, (130, 160, 200), stretch=1.2)
    canvas.disc(0.45, 1.75, 0.12, shaded(DARK, float(rng.uniform(0.6, 2.0))), stretch=0.7)
    return canvas


FURNITURE: dict[str, Callable[[np.random.Generator], Canvas]] = {
    'round tree': _round_tree,
    'lamp': _lamp,
    'advertising column': _advertising_column,
    'poplar': _poplar,
    'letter box': _letter_box,
    'road sign': _road_sign,
    'bush': _bush,
    'church tower': _church_tower,
    'chimney': _chimney,
}
