# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The windows of the demo world's houses."""

from __future__ import annotations

from collections.abc import Callable

from hdc_place_recognition.demo.canvas import Canvas, Color, DARK, GLASS, shaded
import numpy as np


def _sash(canvas: Canvas, trim: Color, x: float, y: float, rng: np.random.Generator) -> None:
    """Paint a tall window with glazing bars."""
    _pane(canvas, trim, x - 0.5, y, x + 0.5, y + 1.7, rng)
    canvas.box(x - 0.04, y, x + 0.04, y + 1.7, trim)
    canvas.box(x - 0.5, y + 1.0, x + 0.5, y + 1.08, trim)
    canvas.box(x - 0.7, y - 0.15, x + 0.7, y, shaded(trim, 0.8))


def _arched(canvas: Canvas, trim: Color, x: float, y: float, rng: np.random.Generator) -> None:
    canvas.disc(x, y + 1.3, 0.75, trim)
    canvas.disc(x, y + 1.3, 0.58, GLASS)
    _pane(canvas, trim, x - 0.6, y - 0.2, x + 0.6, y + 1.3, rng)
    canvas.box(x - 0.04, y, x + 0.04, y + 1.85, trim)


def _shuttered(canvas: Canvas, trim: Color, x: float, y: float, rng: np.random.Generator) -> None:
    _pane(canvas, (225, 230, 232), x - 0.42, y, x + 0.42, y + 1.5, rng)
    for left in (x - 0.95, x + 0.45):
        canvas.box(left, y - 0.05, left + 0.5, y + 1.55, trim)
        for slat in np.arange(y + 0.1, y + 1.4, 0.22):
            canvas.box(left + 0.08, slat, left + 0.42, slat + 0.08, shaded(trim, 0.6))


def _ribbon(canvas: Canvas, trim: Color, x: float, y: float, rng: np.random.Generator) -> None:
    """Paint one bay of a band of glass from wall to wall."""
    _pane(canvas, trim, x - 1.45, y, x + 1.45, y + 1.6, rng)


def _balcony(canvas: Canvas, trim: Color, x: float, y: float, rng: np.random.Generator) -> None:
    _pane(canvas, trim, x - 0.6, y - 0.7, x + 0.6, y + 1.5, rng)
    canvas.box(x - 0.95, y - 0.75, x + 0.95, y - 0.6, shaded(trim, 0.7))
    for rod in np.linspace(x - 0.93, x + 0.88, 9):
        canvas.box(float(rod), y - 0.6, float(rod) + 0.06, y + 0.25, DARK)
    canvas.box(x - 0.95, y + 0.2, x + 0.95, y + 0.3, DARK)
    if rng.random() < 0.5:
        canvas.box(x - 0.7, y - 0.2, x + 0.5, y + 0.12, (60, 140, 70))


def _framed(canvas: Canvas, trim: Color, x: float, y: float, rng: np.random.Generator) -> None:
    """Paint a small square window in a broad colored frame."""
    canvas.box(x - 0.85, y - 0.25, x + 0.85, y + 1.55, trim)
    canvas.box(x - 0.85, y - 0.25, x + 0.85, y + 1.55, shaded(trim, 0.7), border=0.1)
    _pane(canvas, (230, 230, 230), x - 0.5, y + 0.1, x + 0.5, y + 1.2, rng)


def _blind(canvas: Canvas, trim: Color, x: float, y: float, rng: np.random.Generator) -> None:
    """Paint nothing."""


def _pane(
    canvas: Canvas,
    frame: Color,
    left: float,
    bottom: float,
    right: float,
    top: float,
    rng: np.random.Generator,
) -> None:
    """Paint a framed pane of random brightness, with a curtain or a blind at random."""
    canvas.box(left, bottom, right, top, frame)
    inner = left + 0.1, bottom + 0.1, right - 0.1, top - 0.1
    canvas.box(*inner, shaded(GLASS, float(rng.uniform(0.7, 1.4))))
    kind = rng.random()
    if kind < 0.3:
        canvas.box(inner[0], inner[1] + (top - bottom) * 0.45, inner[2], inner[3], (190, 200, 205))
    elif kind < 0.5:
        canvas.box(inner[0], inner[1], inner[0] + (right - left) * 0.3, inner[3], (150, 160, 200))


WINDOWS: dict[str, Callable[[Canvas, Color, float, float, np.random.Generator], None]] = {
    'sash': _sash,
    'arched': _arched,
    'shuttered': _shuttered,
    'ribbon': _ribbon,
    'balcony': _balcony,
    'framed': _framed,
    'blind': _blind,
}
