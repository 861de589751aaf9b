# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A canvas in metres, on which the textures of the demo world are painted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]  # blue, green, red
Point = tuple[float, float]
# Also an (n, 2) array.
Points = Sequence[Point] | Sequence[NDArray[np.float64]] | NDArray[np.float64]
T = TypeVar('T')

SUBPIXEL_BITS = 4
FONT = cv2.FONT_HERSHEY_SIMPLEX
DARK: Colour = (48, 42, 38)
GLASS: Colour = (92, 78, 64)


class Canvas:
    """BGR and opacity, painted in metres: x to the right, y up, origin at the bottom left."""

    def __init__(
        self, width: float, height: float, pixels_per_metre: float, colour: Colour | None = None
    ) -> None:
        """
        Make a canvas.

        :param width: metres.
        :param height: metres.
        :param pixels_per_metre: resolution.
        :param colour: of the ground; None for a transparent canvas.
        """
        self.width, self.height, self.scale = width, height, pixels_per_metre
        shape = round(height * pixels_per_metre), round(width * pixels_per_metre), 4
        self.pixels = np.zeros(shape, np.uint8)
        if colour is not None:
            self.pixels[:] = *colour, 255

    def bgr(self) -> NDArray[np.uint8]:
        """Return the (h, w, 3) colours without the opacity."""
        return np.ascontiguousarray(self.pixels[:, :, :3])

    def box(
        self,
        left: float,
        bottom: float,
        right: float,
        top: float,
        colour: Colour,
        border: float = 0.0,
    ) -> None:
        """Fill a rectangle, or draw its border of so many metres inside of it."""
        if border:
            self.box(left, bottom, right, bottom + border, colour)
            self.box(left, top - border, right, top, colour)
            self.box(left, bottom, left + border, top, colour)
            self.box(right - border, bottom, right, top, colour)
        else:
            self.polygon([(left, bottom), (right, bottom), (right, top), (left, top)], colour)

    def polygon(self, points: Points, colour: Colour) -> None:
        """Fill a polygon."""
        cv2.fillPoly(self.pixels, [self._fixed(points)], (*colour, 255), shift=SUBPIXEL_BITS)

    def line(self, points: Points, width: float, colour: Colour) -> None:
        """Draw an open polyline, `width` metres wide."""
        thickness = max(round(width * self.scale), 1)
        cv2.polylines(
            self.pixels,
            [self._fixed(points)],
            False,
            (*colour, 255),
            thickness,
            cv2.LINE_AA,
            SUBPIXEL_BITS,
        )

    def disc(
        self, x: float, y: float, radius: float, colour: Colour, stretch: float = 1.0
    ) -> None:
        """Fill an upright ellipse, `stretch` times as high as wide."""
        angles = np.linspace(0, 2 * np.pi, 20, endpoint=False)
        ring = np.column_stack(
            [x + radius * np.cos(angles), y + radius * stretch * np.sin(angles)]
        )
        self.polygon(ring, colour)

    def text(
        self, words: str, left: float, bottom: float, right: float, top: float, colour: Colour
    ) -> None:
        """Write words as large as fits an opaque rectangle, in its middle."""
        (wide, high), _ = cv2.getTextSize(words, FONT, 1.0, 1)
        scale = min((right - left) / wide, (top - bottom) / high) * self.scale
        x = (left + right) / 2 * self.scale - wide * scale / 2
        y = (self.height - (bottom + top) / 2) * self.scale + high * scale / 2
        place = round(x), round(y)
        thickness = max(round(scale * 4), 1)
        # OpenCV 5 makes the letters' edges transparent: only the colours are taken.
        written = self.bgr()
        cv2.putText(written, words, place, FONT, scale, colour, thickness, cv2.LINE_AA)
        self.pixels[:, :, :3] = written

    def grain(self, strength: float, rng: np.random.Generator, size: float = 0.15) -> None:
        """Roughen all colours by noise in patches of `size` metres."""
        height, width = self.pixels.shape[:2]
        step = max(round(size * self.scale), 1)
        coarse = rng.normal(0, strength, (height // step + 1, width // step + 1))
        noise = cv2.resize(coarse.astype(np.float32), (width, height))
        colours = self.pixels[:, :, :3]
        colours[:] = np.clip(colours + noise[:, :, None], 0, 255)

    def _fixed(self, points: Points) -> NDArray[np.int32]:
        pixels = np.array(points) * (1, -1) * self.scale + (-0.5, len(self.pixels) - 0.5)
        return np.rint(pixels * 2**SUBPIXEL_BITS).astype(np.int32)


def palette(colours: str) -> tuple[Colour, ...]:
    """Return web colours, six hexadecimal digits each, separated by blanks."""
    return tuple((word[2], word[1], word[0]) for word in map(bytes.fromhex, colours.split()))


def outline(points: str) -> tuple[Point, ...]:
    """Return the points of a text like '1,2 3,4'."""
    pairs = (word.split(',') for word in points.split())
    return tuple((float(x), float(y)) for x, y in pairs)


def shaded(colour: Colour, factor: float) -> Colour:
    """Return the colour made darker (factor < 1) or brighter."""
    blue, green, red = (min(round(part * factor), 255) for part in colour)
    return blue, green, red


def shuffled(choices: Sequence[T], rng: np.random.Generator) -> Iterator[T]:
    """Return an endless iterator over the choices, each round in another order."""
    while True:
        for index in rng.permutation(len(choices)):
            yield choices[index]
