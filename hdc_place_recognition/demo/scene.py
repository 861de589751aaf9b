# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The block, and its appearance in one lap: with its light, cars and passers-by."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from hdc_place_recognition.demo.camera import Camera
from hdc_place_recognition.demo.canvas import Canvas, outline, Point, shaded, shuffled
from hdc_place_recognition.demo.cars import car, LENGTH_M
from hdc_place_recognition.demo.fixtures import banners, bare_walls, railing
from hdc_place_recognition.demo.ground import ground, lit_ground
from hdc_place_recognition.demo.house import FLOOR_M, GROUND_FLOOR_M, House
from hdc_place_recognition.demo.light import Light, tinted
from hdc_place_recognition.demo.panels import Panel, Sprite, Texture, upright
from hdc_place_recognition.demo.plan import (
    along_streets,
    BAY_M,
    CURB_M,
    Lot,
    PARKING_M,
    rows,
    SIDEWALK_M,
    STREETS,
)
from hdc_place_recognition.demo.route import Pose
from hdc_place_recognition.demo.shadows import Walls
from hdc_place_recognition.demo.shops import GROUND_FLOORS
from hdc_place_recognition.demo.sprites import FURNITURE, person
from hdc_place_recognition.demo.walls import ROOFS, WALLS
from hdc_place_recognition.demo.windows import WINDOWS
import numpy as np
from numpy.typing import NDArray

STRIP_M = 4.0
FRONT_PIXELS_PER_METER = 32.0
# Furniture of each street; no two streets have the same.
KINDS = (
    ('round tree', 'lamp', 'letter box'),
    ('poplar', 'bush', 'road sign'),
    ('lamp', 'advertising column', 'bush'),
    ('round tree', 'road sign', 'poplar'),
)
# Objects at fixed positions: in the park, on the square and far behind the houses.
PLACED = {
    'round tree': outline(
        '11,-6 16,-5 14,0 10,3 16.5,4 12,6.5 -45,-8 -45,1 -45,10 -45,19 -53,-4 -53,14'
    ),
    'church tower': outline('-58,6'),
    'chimney': outline('50,60'),
}
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class StandingObject:
    """An unlit picture of an object in the street, with its position."""

    place: Point
    picture: Canvas


@dataclass(frozen=True)
class Block:
    """Everything that stays from lap to lap, unlit."""

    fronts: tuple[tuple[Lot, Canvas], ...]
    fixtures: tuple[Panel, ...]
    walls: Walls
    furniture: tuple[StandingObject, ...]
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
            tuple((lot, _front(lot.house, rng)) for lot in lots),
            (*(wall for row in houses for wall in bare_walls(row)), *banners(), *railing()),
            walls,
            tuple(_furniture(rng)),
            ground(rng),
        )


@dataclass(frozen=True)
class Scene:
    """Everything that is visible in one lap."""

    panels: tuple[Panel, ...]
    sprites: tuple[Sprite, ...]
    sky: NDArray[np.uint8]

    @classmethod
    def of(cls, block: Block, light: Light, camera: Camera, rng: np.random.Generator) -> Scene:
        """Return the block in a light, with random passers-by, parked cars and clouds."""
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


def _front(house: House, rng: np.random.Generator) -> Canvas:
    """Return the painted front of a house, transparent beside its roof."""
    canvas = Canvas(house.width, house.height, FRONT_PIXELS_PER_METER, house.color)
    WALLS[house.wall](canvas, house, rng)
    canvas.grain(3.5, rng)
    _rows_of_windows(canvas, house, rng)
    if rng.random() < 0.5:
        canvas.box(0.05, 0, 0.2, house.eaves, shaded(house.color, 0.6))
    ROOFS[house.roof](canvas, house, rng)
    canvas.box(0, 0, house.width, 0.4, shaded(house.color, 0.55))
    GROUND_FLOORS[house.ground_floor](canvas, house, rng)
    return canvas


def _rows_of_windows(canvas: Canvas, house: House, rng: np.random.Generator) -> None:
    bays = max(round(house.width / float(rng.uniform(2.0, 2.9))), 1)
    for floor in range(house.floors):
        y = GROUND_FLOOR_M + FLOOR_M * floor + 0.75
        for bay in range(bays):
            x = (bay + 0.5) * house.width / bays
            WINDOWS[house.windows](canvas, house.trim, x, y, rng)


def _furniture(rng: np.random.Generator) -> Iterator[StandingObject]:
    """Yield trees, lamps and so on: along the curbs, and at the positions of PLACED."""
    for street, kinds in zip(STREETS, KINDS, strict=True):
        deck = shuffled(kinds, rng)
        for side in (-CURB_M, CURB_M):
            for curb in street.along(side, 5.0):
                if rng.random() < 0.8:
                    yield StandingObject(_beside(curb, 0.8, rng), FURNITURE[next(deck)](rng))
    for kind, places in PLACED.items():
        for place in places:
            yield StandingObject(place, FURNITURE[kind](rng))


def _passers_by(rng: np.random.Generator) -> Iterator[StandingObject]:
    for sidewalk in along_streets(SIDEWALK_M, 2.5):
        if rng.random() < 0.3:
            yield StandingObject(_beside(sidewalk, 0.5, rng), person(rng))


def _parked(rng: np.random.Generator) -> Iterator[Pose]:
    for bay in along_streets(PARKING_M, BAY_M):
        if rng.random() < 0.2:
            yield bay


def _below(parked: list[Pose]) -> Iterator[Point]:
    """Yield points along the cars; the ground is darker there."""
    for pose in parked:
        for along in np.linspace(-LENGTH_M / 3, LENGTH_M / 3, 4).tolist():
            yield pose.x + along * np.cos(pose.yaw), pose.y + along * np.sin(pose.yaw)


def _beside(pose: Pose, spread: float, rng: np.random.Generator) -> Point:
    """Return a random point up to `spread` meters in front of or behind the pose."""
    along = float(rng.uniform(-spread, spread))
    return pose.x + along * float(np.cos(pose.yaw)), pose.y + along * float(np.sin(pose.yaw))


def _lit(panel: Panel, light: Light) -> Panel:
    return Panel(panel.matrix, Texture(tinted(panel.texture.pixels, light.on(panel.normal))))


def _lit_sprite(thing: StandingObject, light: Light) -> Sprite:
    picture = thing.picture
    texture = Texture(tinted(picture.pixels, light.on(UP)))
    return Sprite(thing.place, picture.width, picture.height, texture)


def _lit_front(lot: Lot, picture: Canvas, walls: Walls, light: Light) -> Iterator[Panel]:
    """Yield the front in vertical strips, with the shadows of the houses opposite."""
    count = max(round(lot.house.width / STRIP_M), 1)
    for left, right in pairwise(np.linspace(0, 1, count + 1)):
        columns = slice(*np.rint(np.array([left, right]) * picture.pixels.shape[1]).astype(int))
        foot = [lot.left + share * (lot.right - lot.left) for share in (left, right)]
        strip = upright(foot[0], foot[1], 0.0, picture.height, Texture(picture.pixels[:, columns]))
        in_front = (foot[0] + foot[1]) / 2 - lot.behind * 0.05
        height = walls.shadow_height(in_front, light)
        yield _lit_above(strip, round(height * picture.scale), light)


def _lit_above(strip: Panel, rows: int, light: Light) -> Panel:
    """Return the strip with its lowest rows in the shade and the others in the sun."""
    pixels = strip.texture.pixels
    edge = max(len(pixels) - rows, 0)
    sunny = tinted(pixels[:edge], light.on(strip.normal))
    lit = np.vstack([sunny, tinted(pixels[edge:], light.shade)])
    opaque = bool((lit[:, :, 3] == 255).all())
    return Panel(strip.matrix, Texture(np.ascontiguousarray(lit[:, :, :3]) if opaque else lit))
