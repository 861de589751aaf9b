# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What is decided of a house before it is painted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from hdc_place_recognition.demo.canvas import Colour, palette, shuffled
import numpy as np

GROUND_FLOOR_M = 3.8
FLOOR_M = 3.1
ROOF_M = 2.2

COLOURS = palette(
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
    A house without its place.

    :param width: of the front, metres.
    :param floors: above the ground floor.
    :param colour: of the walls.
    :param trim: colour of frames, ledges and shutters.
    :param accent: colour of doors, boards and awnings.
    :param wall: the painter's name, as those of `windows`, `roof` and `ground_floor`.
    :param name: on the board above the shop.
    """

    width: float
    floors: int
    colour: Colour
    trim: Colour
    accent: Colour
    wall: str
    windows: str
    roof: str
    ground_floor: str
    name: str

    @property
    def eaves(self) -> float:
        """Return the height of the roof's lower edge in metres."""
        return GROUND_FLOOR_M + FLOOR_M * self.floors

    @property
    def height(self) -> float:
        """Return the height of the front in metres."""
        return self.eaves + ROOF_M


# Returns the next house, of the width it is given.
Builder = Callable[[float], House]


def town_houses(rng: np.random.Generator) -> Builder:
    """Return a builder of houses of which successive ones differ in nearly every respect."""
    looks = (COLOURS, TRIMS, ACCENTS)
    painters = (WALLS, WINDOWS, ROOFS, GROUND_FLOORS)
    choices: tuple[Sequence[Any], ...] = ((2, 3, 4), *looks, *painters, NAMES.split(','))
    designs = zip(*(shuffled(choice, rng) for choice in choices), strict=False)
    return lambda width: House(width, *next(designs))


def viaduct_arches() -> Builder:
    """Return a builder of the arches of a railway viaduct."""
    colour, trim, accent = palette('9e8068 886e5a 32323c')
    return lambda width: House(
        width, 1, colour, trim, accent, 'stones', 'blind', 'parapet', 'viaduct', ''
    )
