# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The plan of the block: positions of houses, park, canal and streets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from hdc_place_recognition.demo.canvas import outline, Point
from hdc_place_recognition.demo.house import Builder, House, town_houses, viaduct_arches
from hdc_place_recognition.demo.route import HALF_LENGTH_M, HALF_WIDTH_M, Pose
import numpy as np
from numpy.typing import NDArray

# The map: meters east and north of the middle of the block.
WEST_M, SOUTH_M, EAST_M, NORTH_M = -70.0, -40.0, 70.0, 50.0

# House lines, from left to right as seen from the street: the far bank of a canal in the north; a
# side street and a yard in the east, a square in the west; the block itself, with a park at its
# east end.
HOUSE_LINES = (
    outline('-69,27 -69,49 69,49 69,27 38,27'),
    outline(
        '38,-11 66,-11 66,-25 38,-25 38,-28 16,-28 16,-38 2,-38 2,-28 -38,-28 -38,-14 -62,-14 '
        '-62,27 -69,27'
    ),
    outline('-18,-8 8,-8 8,8 2,8 2,3 -5,3 -5,8 -11,8 -18,1 -18,-8'),
)
VIADUCT = outline('38,27 38,-11')
PARK = outline('8,-8.5 16,-8.5 18.5,-6 18.5,6 16,8.5 8,8.5')
CANAL = outline('-69,28 69,28 69,46 -69,46')
RAILING = outline('-62,27 38,27')
SIDE_STREET = outline('28,-18 66,-18')
HOUSE_WIDTH_M = 8.5

# Distances from the middle of the road, on both sides.
ROAD_M = 5.5
PARKING_M = 4.4
CURB_M = 6.3
SIDEWALK_M = 7.8

BAY_M = 5.4
CORNER_FREE_M = 11.0  # without bays and furniture


@dataclass(frozen=True)
class Lot:
    """A house and the (2,) end points of its front, from left to right as seen from the street."""

    left: NDArray[np.float64]
    right: NDArray[np.float64]
    house: House

    @property
    def along(self) -> NDArray[np.float64]:
        """Return the (2,) unit vector from left to right."""
        return (self.right - self.left) / self.house.width

    @property
    def behind(self) -> NDArray[np.float64]:
        """Return the (2,) unit vector from the front into the house."""
        x, y = self.along
        return np.array([-y, x])


def rows(rng: np.random.Generator) -> Iterator[tuple[Lot, ...]]:
    """Yield the lots along each straight part of the house lines, and the viaduct."""
    town = town_houses(rng)
    for line in HOUSE_LINES:
        for start, end in pairwise(np.array(line)):
            yield tuple(_row(start, end, town, rng))
    start, end = np.array(VIADUCT)
    yield tuple(_row(start, end, viaduct_arches(), rng))


def _row(
    start: NDArray[np.float64], end: NDArray[np.float64], build: Builder, rng: np.random.Generator
) -> Iterator[Lot]:
    length = float(np.hypot(*(end - start)))
    shares = rng.uniform(0.8, 1.25, max(round(length / HOUSE_WIDTH_M), 1))
    edges = np.concatenate([[0], np.cumsum(shares) / shares.sum()])
    for left, right in pairwise(start + edges[:, None] * (end - start)):
        yield Lot(left, right, build(float(np.hypot(*(right - left)))))


@dataclass(frozen=True)
class Street:
    """One of the four straight streets, `reach` meters to both sides of its middle."""

    middle: Point
    yaw: float
    reach: float

    def at(self, ahead: float, left: float) -> Point:
        """Return the point `ahead` meters down the street and `left` meters to the left."""
        cos, sin = float(np.cos(self.yaw)), float(np.sin(self.yaw))
        x, y = self.middle
        return x + ahead * cos - left * sin, y + ahead * sin + left * cos

    def along(self, left: float, spacing: float) -> Iterator[Pose]:
        """Yield poses `left` meters to the left of the middle, heading down the street."""
        for ahead in np.arange(spacing / 2 - self.reach, self.reach, spacing).tolist():
            yield Pose(*self.at(ahead, left), self.yaw)


STREETS = (
    Street((0, -HALF_WIDTH_M), 0.0, HALF_LENGTH_M - CORNER_FREE_M),
    Street((HALF_LENGTH_M, 0), np.pi / 2, HALF_WIDTH_M - CORNER_FREE_M),
    Street((0, HALF_WIDTH_M), np.pi, HALF_LENGTH_M - CORNER_FREE_M),
    Street((-HALF_LENGTH_M, 0), -np.pi / 2, HALF_WIDTH_M - CORNER_FREE_M),
)


def along_streets(offset: float, spacing: float) -> Iterator[Pose]:
    """Yield the poses of `Street.along` for all streets, on both sides."""
    for street in STREETS:
        for side in (-offset, offset):
            yield from street.along(side, spacing)
