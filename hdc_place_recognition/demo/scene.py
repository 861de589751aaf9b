# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The block as it is built, and as it looks in one lap: in its light, with who is there then."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from hdc_place_recognition.demo.camera import Camera
from hdc_place_recognition.demo.canvas import Canvas, outline, Point, shuffled
from hdc_place_recognition.demo.cars import car, LENGTH_M
from hdc_place_recognition.demo.facades import front
from hdc_place_recognition.demo.fixtures import banners, bare_walls, railing
from hdc_place_recognition.demo.ground import ground, lit_ground
from hdc_place_recognition.demo.light import Light, tinted
from hdc_place_recognition.demo.panels import Panel, Sprite, Texture, upright
from hdc_place_recognition.demo.plan import (
    along_streets,
    BAY_M,
    KERB_M,
    Lot,
    PARKING_M,
    PAVEMENT_M,
    rows,
    STREETS,
)
from hdc_place_recognition.demo.route import Pose
from hdc_place_recognition.demo.shadows import Walls
from hdc_place_recognition.demo.sprites import FURNITURE, person
import numpy as np
from numpy.typing import NDArray

STRIP_M = 4.0
# Kinds of furniture of each street: none looks like another.
KINDS = (
    ('round tree', 'lamp', 'letter box'),
    ('poplar', 'bush', 'road sign'),
    ('lamp', 'advertising column', 'bush'),
    ('round tree', 'road sign', 'poplar'),
)
# Things with a place of their own: in the park, on the square and far behind the houses.
PLACED = {
    'round tree': outline(
        '11,-6 16,-5 14,0 10,3 16.5,4 12,6.5 -45,-8 -45,1 -45,10 -45,19 -53,-4 -53,14'
    ),
    'church tower': outline('-58,6'),
    'chimney': outline('50,60'),
}
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Standing:
    """A picture, not yet lit, that stands somewhere in the street."""

    place: Point
    picture: Canvas


@dataclass(frozen=True)
class Block:
    """What stays from lap to lap, unlit."""

    fronts: tuple[tuple[Lot, Canvas], ...]
    fixtures: tuple[Panel, ...]
    walls: Walls
    furniture: tuple[Standing, ...]
    ground: NDArray[np.uint8]

    @classmethod
    def build(cls, rng: np.random.Generator) -> Block:
        """Return a block of random houses and furniture."""
        houses = tuple(rows(rng))
        lots = [lot for row in houses for lot in row]
        walls = Walls(
            np.array([lot.left for lot in lots]),
            np.array([lot.right for lot in lots]),
            np.array([lot.house.height for lot in lots]),
        )
        return cls(
            tuple((lot, front(lot.house, rng)) for lot in lots),
            (*(wall for row in houses for wall in bare_walls(row)), *banners(), *railing()),
            walls,
            tuple(_furniture(rng)),
            ground(rng),
        )


@dataclass(frozen=True)
class Scene:
    """What there is to be seen in one lap."""

    panels: tuple[Panel, ...]
    sprites: tuple[Sprite, ...]
    sky: NDArray[np.uint8]

    @classmethod
    def of(cls, block: Block, light: Light, camera: Camera, rng: np.random.Generator) -> Scene:
        """Return the block in this light, with random passers-by, parked cars and clouds."""
        parked = list(_parked(rng))
        standing = [*block.furniture, *_passers_by(rng)]
        spots = np.array([thing.place for thing in standing] + list(_below(parked)))
        panels = [
            *lit_ground(block.ground, block.walls, spots, light),
            *(_lit(panel, light) for panel in block.fixtures),
            *(_lit(panel, light) for pose in parked for panel in car(pose, rng)),
            *(
                panel
                for lot, picture in block.fronts
                for panel in _lit_front(lot, picture, block.walls, light)
            ),
        ]
        sprites = tuple(_lit_sprite(thing, light) for thing in standing)
        return cls(tuple(panels), sprites, light.sky(camera, rng))


def _furniture(rng: np.random.Generator) -> Iterator[Standing]:
    """Return trees and the like: along the kerbs, and those of PLACED."""
    for street, kinds in zip(STREETS, KINDS, strict=True):
        deck = shuffled(kinds, rng)
        for side in (-KERB_M, KERB_M):
            for kerb in street.along(side, 5.0):
                if rng.random() < 0.8:
                    yield Standing(_beside(kerb, 0.8, rng), FURNITURE[next(deck)](rng))
    for kind, places in PLACED.items():
        for place in places:
            yield Standing(place, FURNITURE[kind](rng))


def _passers_by(rng: np.random.Generator) -> Iterator[Standing]:
    for pavement in along_streets(PAVEMENT_M, 2.5):
        if rng.random() < 0.3:
            yield Standing(_beside(pavement, 0.5, rng), person(rng))


def _parked(rng: np.random.Generator) -> Iterator[Pose]:
    for bay in along_streets(PARKING_M, BAY_M):
        if rng.random() < 0.2:
            yield bay


def _below(parked: list[Pose]) -> Iterator[Point]:
    """Return places along the cars, which darken the ground there."""
    for pose in parked:
        for along in np.linspace(-LENGTH_M / 3, LENGTH_M / 3, 4).tolist():
            yield pose.x + along * np.cos(pose.yaw), pose.y + along * np.sin(pose.yaw)


def _beside(pose: Pose, spread: float, rng: np.random.Generator) -> Point:
    """Return a place up to so many metres before or behind the pose."""
    along = float(rng.uniform(-spread, spread))
    return pose.x + along * float(np.cos(pose.yaw)), pose.y + along * float(np.sin(pose.yaw))


def _lit(panel: Panel, light: Light) -> Panel:
    return Panel(panel.matrix, Texture(tinted(panel.texture.pixels, light.on(panel.normal))))


def _lit_sprite(thing: Standing, light: Light) -> Sprite:
    picture = thing.picture
    texture = Texture(tinted(picture.pixels, light.on(UP)))
    return Sprite(thing.place, picture.width, picture.height, texture)


def _lit_front(lot: Lot, picture: Canvas, walls: Walls, light: Light) -> Iterator[Panel]:
    """Return the front in upright strips, each with the shadow of the houses opposite."""
    count = max(round(lot.house.width / STRIP_M), 1)
    for left, right in pairwise(np.linspace(0, 1, count + 1)):
        columns = slice(*np.rint(np.array([left, right]) * picture.pixels.shape[1]).astype(int))
        foot = [lot.left + share * (lot.right - lot.left) for share in (left, right)]
        strip = upright(foot[0], foot[1], 0.0, picture.height, Texture(picture.pixels[:, columns]))
        in_front = (foot[0] + foot[1]) / 2 - lot.behind * 0.05
        height = walls.shadow_height(in_front, light)
        yield _lit_above(strip, round(height * picture.scale), light)


def _lit_above(strip: Panel, rows: int, light: Light) -> Panel:
    """Return the strip with its lowest rows in the shade and the rest in the sun."""
    pixels = strip.texture.pixels
    edge = max(len(pixels) - rows, 0)
    sunny = tinted(pixels[:edge], light.on(strip.normal))
    lit = np.vstack([sunny, tinted(pixels[edge:], light.shade)])
    opaque = bool((lit[:, :, 3] == 255).all())
    return Panel(strip.matrix, Texture(np.ascontiguousarray(lit[:, :, :3]) if opaque else lit))
