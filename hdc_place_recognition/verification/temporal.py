# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether successive images point to neighbouring places."""

from __future__ import annotations

from collections import deque

import numpy as np

_IMAGES = 3
# Rows that a match may move from one image to the next, and those it may be off anyway.
_SPEED, _SLACK = 2, 2
# From this strength on an image supports others, from that one fully.
_FROM, _FULL = 1.45, 2.25
_ENOUGH = 2.0


class Consistency:
    """
    The best places of the last images, which support a candidate near them.

    Near in either direction: a path may be travelled backwards. Nothing waits for images to come.
    """

    def __init__(self) -> None:
        self._places: deque[tuple[int, float]] = deque(maxlen=_IMAGES + 1)

    def support(self, row: int, moved: bool) -> float:
        """
        Return how much the last images support a row, 0 to 1.

        :param moved: whether the image shows something new; if not, the last one showed the
            same, and an image must not confirm itself.
        """
        # The last image is one step away, or the same place if the robot has not moved since.
        ages = enumerate(reversed(self._places), start=1 if moved else 0)
        weights = [
            float(np.clip((strength - _FROM) / (_FULL - _FROM), 0, 1))
            for age, (place, strength) in ages
            if 1 <= age <= _IMAGES and abs(row - place) <= _SLACK + _SPEED * age
        ]
        return min(sum(weights), _ENOUGH) / _ENOUGH

    def remember(self, row: int, strength: float) -> None:
        """Note the best place of an image that shows something new."""
        self._places.append((row, strength))

    def forget(self, row: int) -> None:
        """Follow the rows when one of them is taken out: those after it move up."""
        places = [(place - (place > row), strength) for place, strength in self._places]
        self._places = deque(places, self._places.maxlen)

    def clear(self) -> None:
        """Forget the images so far."""
        self._places.clear()
