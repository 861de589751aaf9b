# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A canvas in meters: the textures of the demo world are painted on it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

Color = tuple[int, int, int]  # blue, green, red
Point = tuple[float, float]
# Also an (n, 2) array.
Points = Sequence[Point] | Sequence[NDArray[np.float64]] | NDArray[np.float64]
T = TypeVar('T')

SUBPIXEL_BITS = 4
FONT = cv2.FONT_HERSHEY_SIMPLEX
DARK: Color = (48, 42, 38)
GLASS: Color = (92, 78, 64)


class Canvas:
    """A BGRA image with coordinates in meters: x right, y up, origin at the bottom left."""

    def __init__(
        self, width: float, height: float, pixels_per_meter: float, color: Color | None = None
    ) -> None:
        """
        Make a canvas.

        :param width: meters.
        :param height: meters.
        :param pixels_per_meter: resolution.
        :param color: background; None for a transparent canvas.
        """
        self.width, self.height, self.scale = width, height, pixels_per_meter
        shape = round(height * pixels_per_meter), round(width * pixels_per_meter), 4
        self.pixels = np.zeros(shape, np.uint8)
        if color is not None:
            self.pixels[:] = *color, 255

    def bgr(self) -> NDArray[np.uint8]:
        """Return the (h, w, 3) colors without opacity."""
        return np.ascontiguousarray(self.pixels[:, :, :3])

    def box(
        self,
        left: float,
        bottom: float,
        right: float,
        top: float,
        color: Color,
        border: float = 0.0,
    ) -> None:
        """Fill a rectangle, or draw its border of this width in meters, on the inside."""
        if border:
            self.box(left, bottom, right, bottom + border, color)
            self.box(left, top - border, right, top, color)
            self.box(left, bottom, left + border, top, color)
            self.box(right - border, bottom, right, top, color)
        else:
            self.polygon([(left, bottom), (right, bottom), (right, top), (left, top)], color)

    def polygon(self, points: Points, color: Color) -> None:
        """Fill a polygon."""
        cv2.fillPoly(self.pixels, [self._fixed(points)], (*color, 255), shift=SUBPIXEL_BITS)

    def line(self, points: Points, width: float, color: Color) -> None:
        """Draw an open polyline, `width` meters wide."""
        thickness = max(round(width * self.scale), 1)
        cv2.polylines(
            self.pixels,
            [self._fixed(points)],
            False,
            (*color, 255),
            thickness,
            cv2.LINE_AA,
            SUBPIXEL_BITS,
        )

    def disc(self, x: float, y: float, radius: float, color: Color, stretch: float = 1.0) -> None:
        """Fill an ellipse, `stretch` times as high as wide."""
        angles = np.linspace(0, 2 * np.pi, 20, endpoint=False)
        ring = np.column_stack(
            [x + radius * np.cos(angles), y + radius * stretch * np.sin(angles)]
        )
        self.polygon(ring, color)

    def text(
        self, words: str, left: float, bottom: float, right: float, top: float, color: Color
    ) -> None:
        """Write words centered in an opaque rectangle, as large as fits."""
        (wide, high), _ = cv2.getTextSize(words, FONT, 1.0, 1)
        scale = min((right - left) / wide, (top - bottom) / high) * self.scale
        x = (left + right) / 2 * self.scale - wide * scale / 2
        y = (self.height - (bottom + top) / 2) * self.scale + high * scale / 2
        place = round(x), round(y)
        thickness = max(round(scale * 4), 1)
        # OpenCV 5 makes the edges of letters transparent: copy only the colors.
        written = self.bgr()
        cv2.putText(written, words, place, FONT, scale, color, thickness, cv2.LINE_AA)
        self.pixels[:, :, :3] = written

    def grain(self, strength: float, rng: np.random.Generator, size: float = 0.15) -> None:
        """Add noise to all colors, in patches of `size` meters."""
        height, width = self.pixels.shape[:2]
        step = max(round(size * self.scale), 1)
        coarse = rng.normal(0, strength, (height // step + 1, width // step + 1))
        noise = cv2.resize(coarse.astype(np.float32), (width, height))
        colors = self.pixels[:, :, :3]
        colors[:] = np.clip(colors + noise[:, :, None], 0, 255)

    def _fixed(self, points: Points) -> NDArray[np.int32]:
        pixels = np.array(points) * (1, -1) * self.scale + (-0.5, len(self.pixels) - 0.5)
        return np.rint(pixels * 2**SUBPIXEL_BITS).astype(np.int32)


def palette(colors: str) -> tuple[Color, ...]:
    """Parse web colors: six hexadecimal digits each, separated by blanks."""
    return tuple((word[2], word[1], word[0]) for word in map(bytes.fromhex, colors.split()))


def outline(points: str) -> tuple[Point, ...]:
    """Parse points such as '1,2 3,4'."""
    pairs = (word.split(',') for word in points.split())
    return tuple((float(x), float(y)) for x, y in pairs)


def shaded(color: Color, factor: float) -> Color:
    """Return a darker (factor < 1) or brighter color."""
    blue, green, red = (min(round(part * factor), 255) for part in color)
    return blue, green, red


def shuffled(choices: Sequence[T], rng: np.random.Generator) -> Iterator[T]:
    """Iterate endlessly over the choices, in a new random order in each round."""
    while True:
        for index in rng.permutation(len(choices)):
            yield choices[index]
