# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The design of a house, before it is painted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from hdc_place_recognition.demo.canvas import Color, palette, shuffled
import numpy as np

GROUND_FLOOR_M = 3.8
FLOOR_M = 3.1
ROOF_M = 2.2

COLORS = palette(
    'ecdebe deb478 c47860 e2b0b0 b0d6c4 96bed6 b8b6b2 ebe8e4 96544a 688670 eec896 7a808c c8965a'
)
TRIMS = palette('f0eeeb aa9678 5c463c 466e5a 3c5478 8c4646 d2c4a0')
ACCENTS = palette('b43232 288c6e 1e5096 ebbe3c 326e3c 783c82 dc6e28 323c46 3c96a0')
WALLS = ('plaster', 'bricks', 'stones', 'timber', 'cladding')
WINDOWS = ('sash', 'arched', 'shuttered', 'ribbon', 'balcony', 'framed')
ROOFS = ('parapet', 'tiles', 'mansard', 'crenels', 'gable')
GROUND_FLOORS = ('shop', 'cafe', 'entrance', 'garage', 'arcade', 'market')
NAMES = (
    'BAKERY,CAFE LUNA,BOOKS,PHARMACY,HOTEL ROMA,FLOWERS,CINEMA,OPTICIAN,BIKES,TAILOR,PIZZA,MUSIC,'
    'BANK,TOYS,FISH,BARBER,TEA HOUSE,SHOES,GALLERY,WINE,LAUNDRY,RADIO,CHEESE,POST,KEYS,HATS,'
    'LIBRARY,CLOCKS'
)


@dataclass(frozen=True)
class House:
    """
    The design of a house, without its position.

    :param width: width of the front, meters.
    :param floors: number of floors above the ground floor.
    :param color: color of the walls.
    :param trim: color of frames, ledges and shutters.
    :param accent: color of doors, boards and awnings.
    :param wall: name of the painter, as for `windows`, `roof` and `ground_floor`.
    :param name: text on the board above the shop.
    """

    width: float
    floors: int
    color: Color
    trim: Color
    accent: Color
    wall: str
    windows: str
    roof: str
    ground_floor: str
    name: str

    @property
    def eaves(self) -> float:
        """Return the height of the lower edge of the roof in meters."""
        return GROUND_FLOOR_M + FLOOR_M * self.floors

    @property
    def height(self) -> float:
        """Return the height of the front in meters."""
        return self.eaves + ROOF_M


# Returns the next house, of the given width.
Builder = Callable[[float], House]


def town_houses(rng: np.random.Generator) -> Builder:
    """Return a builder of houses; successive houses differ in nearly every respect."""
    looks = (COLORS, TRIMS, ACCENTS)
    painters = (WALLS, WINDOWS, ROOFS, GROUND_FLOORS)
    choices: tuple[Sequence[Any], ...] = ((2, 3, 4), *looks, *painters, NAMES.split(','))
    designs = zip(*(shuffled(choice, rng) for choice in choices), strict=False)
    return lambda width: House(width, *next(designs))


def viaduct_arches() -> Builder:
    """Return a builder of the arches of a railway viaduct."""
    color, trim, accent = palette('9e8068 886e5a 32323c')
    return lambda width: House(
        width, 1, color, trim, accent, 'stones', 'blind', 'parapet', 'viaduct', ''
    )
