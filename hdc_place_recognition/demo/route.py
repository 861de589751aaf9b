# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The drive around the block, counterclockwise: exact pose of the vehicle at each time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

# The middle of the road: half the extents of its rectangle, and the length of a curve.
HALF_LENGTH_M = 28.0
HALF_WIDTH_M = 17.0
CORNER_M = 14.0
START_M = 12.0  # past the south-west corner

LANES_M = (-0.5, 0.5)  # to the left of the middle: first lap, later laps
LANE_CHANGE_M = 10.0  # ends at the end of the first lap
STRAIGHT_SPEED = 5.4  # m/s
CORNER_SPEED = 4.0

START_NS = 1_779_267_600_123_456_789
ODOMETRY_PERIOD_NS = 50_000_000
IMAGE_PERIOD_NS = 250_000_000
IMAGE_DELAY_NS = 7_340_000  # after the odometry of the same cycle
GRID_M = 0.02


@dataclass(frozen=True)
class Pose:
    """Position in meters, and yaw in radians, counterclockwise from east."""

    x: float
    y: float
    yaw: float


@dataclass(frozen=True)
class Moment:
    """State of the vehicle at one time: speed in m/s, yaw rate in rad/s, lap counted from 0."""

    stamp_ns: int
    pose: Pose
    speed: float
    yaw_rate: float
    lap: int


class Route:
    """A drive of some laps, or a fraction of a lap, slower at corners."""

    def __init__(self, laps: float) -> None:
        road = _Road()
        driven = np.arange(0, laps * road.length + GRID_M, GRID_M)
        points, yaw = road.lane(START_M + driven, _lane_offset(driven - road.length))
        steps = np.hypot(*np.diff(points, axis=0, prepend=points[:1]).T)
        speed = STRAIGHT_SPEED + (CORNER_SPEED - STRAIGHT_SPEED) * road.turning(START_M + driven)
        self._seconds = np.cumsum(steps / speed)
        yaw_rate = np.gradient(yaw, self._seconds)
        self._states = np.column_stack([points, yaw, speed, yaw_rate, driven / road.length])

    def images(self) -> Iterator[Moment]:
        """Iterate over the moments at which an image is taken, in order."""
        return self._every(IMAGE_PERIOD_NS, IMAGE_DELAY_NS)

    def odometry(self) -> Iterator[Moment]:
        """Iterate over the moments at which odometry is sent, in order."""
        return self._every(ODOMETRY_PERIOD_NS, 0)

    def _every(self, period_ns: int, delay_ns: int) -> Iterator[Moment]:
        for elapsed_ns in range(delay_ns, int(self._seconds[-1] * 1e9), period_ns):
            yield self._moment(elapsed_ns)

    def _moment(self, elapsed_ns: int) -> Moment:
        x, y, yaw, speed, yaw_rate, laps = (
            float(np.interp(elapsed_ns * 1e-9, self._seconds, state)) for state in self._states.T
        )
        pose = Pose(x, y, float(np.arctan2(np.sin(yaw), np.cos(yaw))))
        return Moment(START_NS + elapsed_ns, pose, speed, yaw_rate, int(laps))


class _Road:
    """The middle of the road, a rectangle with smooth corners."""

    def __init__(self) -> None:
        steps = np.arange(GRID_M / 2, CORNER_M, GRID_M) / CORNER_M
        reach = CORNER_M * float(np.cos(np.pi / 2 * _smooth(steps)).mean())
        straights = 2 * np.array([HALF_LENGTH_M, HALF_WIDTH_M] * 2) - 2 * reach
        self._corners = np.cumsum(straights + CORNER_M) - CORNER_M
        self._origin = np.array([reach - HALF_LENGTH_M, -HALF_WIDTH_M])
        self.length = float(self._corners[-1] + CORNER_M)

    @cached_property
    def _points(self) -> NDArray[np.float64]:
        """Return the (n, 2) points of one lap, GRID_M apart; the last equals the first."""
        count = round(self.length / GRID_M)
        middles = self.direction((np.arange(count) + 0.5) / count * self.length)
        steps = np.column_stack([np.cos(middles), np.sin(middles)]) * self.length / count
        return self._origin + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])

    def direction(self, distances: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the yaw in radians at distances along the road, not wrapped."""
        laps, within = np.divmod(distances, self.length)
        turns = _smooth((within[:, None] - self._corners) / CORNER_M).sum(1) + 4 * laps
        return np.asarray(np.pi / 2 * turns)

    def turning(self, distances: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return 1 in the middle of a corner, and 0 from CORNER_M away on."""
        middles = self._corners + CORNER_M / 2
        half = self.length / 2
        away = np.abs(np.mod(distances[:, None] - middles + half, self.length) - half).min(1)
        return np.asarray(np.cos(np.pi / 2 * np.minimum(away / CORNER_M, 1)) ** 2)

    def lane(
        self, distances: NDArray[np.float64], offsets: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the (n, 2) points `offsets` meters to the left of the middle, and their yaw."""
        grid = np.linspace(0, self.length, len(self._points))
        within = np.mod(distances, self.length)
        middle = np.column_stack([np.interp(within, grid, column) for column in self._points.T])
        direction = self.direction(distances)
        left = np.column_stack([-np.sin(direction), np.cos(direction)])
        points = middle + left * offsets[:, None]
        steps = np.gradient(points, axis=0)
        return points, np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))


def _lane_offset(past_first_lap: NDArray[np.float64]) -> NDArray[np.float64]:
    first, later = LANES_M
    return first + (later - first) * _smooth(past_first_lap / LANE_CHANGE_M + 1)


def _smooth(fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a smooth step from 0 at 0 to 1 at 1, constant outside."""
    within = np.clip(fraction, 0, 1)
    return np.asarray(within * within * (3 - 2 * within))
