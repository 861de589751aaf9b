# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Flat objects of the block other than house fronts: bare walls, banners, a railing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from hdc_place_recognition.demo.canvas import Canvas, Color, DARK, shaded
from hdc_place_recognition.demo.house import House
from hdc_place_recognition.demo.panels import Panel, Texture, upright
from hdc_place_recognition.demo.plan import CURB_M, Lot, RAILING, STREETS
import numpy as np
from numpy.typing import NDArray

DEPTH_M = 5.0
INSET_M = 0.05  # of bare walls, behind the fronts around the corner
POST_M = 2.0
# Text, color and position along the street (-1 to 1) of the banner of each street.
BANNERS: tuple[tuple[str, Color, float], ...] = (
    ('SUMMER FAIR', (60, 60, 200), 0.5),
    ('MUSEUM', (150, 90, 40), -0.2),
    ('BOAT RACE', (60, 190, 230), 0.1),
    ('THEATRE', (70, 130, 50), 0.4),
)


def bare_walls(row: Sequence[Lot]) -> Iterator[Panel]:
    """Yield the backs of the houses of a row, and their sides where they rise above a neighbor."""
    around = [0.0, *(lot.house.eaves for lot in row), 0.0]
    for lot, before, after in zip(row, around[:-2], around[2:], strict=True):
        left, right = lot.left + INSET_M * lot.along, lot.right - INSET_M * lot.along
        behind = DEPTH_M * lot.behind
        yield _bare(lot.house, right + behind, left + behind, 0.0)
        if before < lot.house.eaves:
            yield _bare(lot.house, left + behind, left, before)
        if after < lot.house.eaves:
            yield _bare(lot.house, right, right + behind, after)


def _bare(
    house: House, left: NDArray[np.float64], right: NDArray[np.float64], bottom: float
) -> Panel:
    texture = Texture(np.full((1, 1, 3), shaded(house.color, 0.8), np.uint8))
    return upright(left, right, bottom, house.eaves, texture)


def banners() -> Iterator[Panel]:
    """Yield a banner between two poles across each street."""
    for street, (words, color, share) in zip(STREETS, BANNERS, strict=True):
        canvas = Canvas(2 * CURB_M, 6.8, 32.0)
        for x in (0.0, canvas.width - 0.15):
            canvas.box(x, 0, x + 0.15, canvas.height, DARK)
        canvas.box(0, 5.2, canvas.width, 6.6, color)
        canvas.text(words, 2.0, 5.5, canvas.width - 2.0, 6.3, (240, 245, 245))
        left, right = (street.at(share * street.reach, offset) for offset in (CURB_M, -CURB_M))
        yield upright(left, right, 0.0, canvas.height, Texture(canvas.pixels))


def railing() -> Iterator[Panel]:
    """Yield the panels of the railing along the canal."""
    start, end = np.array(RAILING)
    count = round(float(np.hypot(*(end - start))) / POST_M)
    canvas = Canvas(POST_M, 1.1, 32.0)
    canvas.box(0, 0, 0.12, 1.1, DARK)
    for y in (0.35, 0.7, 1.0):
        canvas.box(0, y, POST_M, y + 0.1, DARK)
    posts = (start + np.linspace(0, 1, count + 1)[:, None] * (end - start)).tolist()
    for left, right in pairwise(posts):
        yield upright(left, right, 0.0, canvas.height, Texture(canvas.pixels))
