# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Temporal consistency: whether successive images match keyframes next to each other."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from hdc_place_recognition.verification.settings import VerificationSettings

# Returns how many keyframes two ids are apart in their traverse, None for different traverses.
Distance = Callable[[int, int], int | None]


class TemporalSupport:
    """
    The best matches of the last images, which support a candidate near them.

    A candidate may lie before or after them: a path may be traveled backwards. No decision waits
    for images to come.

    :param settings: the numbers that decide.
    """

    def __init__(self, settings: VerificationSettings) -> None:
        self._settings = settings
        # One more than can support: an image that shows nothing new is not counted as a step.
        self._matches: deque[tuple[int, float]] = deque(maxlen=settings.support_images + 1)

    @property
    def last(self) -> tuple[int, float] | None:
        """Return the keyframe of the last image's best match and its probability, or None."""
        return self._matches[-1] if self._matches else None

    def of(self, keyframe_id: int, moved: bool, distance: Distance) -> float:
        """
        Return how much the last images support a keyframe, 0 to 1.

        :param moved: whether the query shows something new. If not, the last image showed the
            same, and an image must not confirm itself.
        :param distance: of two keyframes.
        """
        settings, total = self._settings, 0.0
        for age, (matched_id, probability) in enumerate(
            reversed(self._matches), 1 if moved else 0
        ):
            apart = distance(keyframe_id, matched_id)
            reach = settings.support_reach * (1 + age)
            if 1 <= age <= settings.support_images and apart is not None and apart <= reach:
                total += probability
        enough = settings.support_images - 1
        return min(total, enough) / enough

    def remember(self, keyframe_id: int, probability: float) -> None:
        """Note the best match of an image that shows something new, and its certainty."""
        self._matches.append((keyframe_id, probability))
