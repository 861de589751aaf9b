# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which images are stored: those that show something new."""

from __future__ import annotations

from hdc_place_recognition.core.hdc import Hypervector


class KeyframeSelector:
    """Compares each image with the last keyframe."""

    def __init__(self) -> None:
        self._vector: Hypervector | None = None

    def moved(self, vector: Hypervector, most_similar: float) -> bool:
        """
        Return whether an image differs from the last keyframe; it is the next one then.

        :param vector: (d,) float32, of the image; zeros are new to all, and no keyframe.
        :param most_similar: cosine similarity above which the robot stands still.
        """
        if self._vector is not None:
            similarity = min(float(vector @ self._vector), 1.0)
            if similarity > most_similar:
                return False
        if vector.any():
            self._vector = vector
        return True

    def restart(self) -> None:
        """Take the next image for new: another traverse begins."""
        self._vector = None
