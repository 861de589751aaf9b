# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""How much a database may hold, and what it lets go."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Forgotten:
    """An image that is no longer in the database: the row it had, and its number."""

    row: int
    keyframe_id: int


@dataclass(frozen=True)
class Limit:
    """
    What a database may hold; 0 is no limit.

    :param keyframes: images.
    :param megabytes: of memory.
    """

    keyframes: int = 0
    megabytes: float = 0.0

    def __bool__(self) -> bool:
        return self.keyframes > 0 or self.megabytes > 0

    def exceeded(self, keyframes: int, nbytes: int) -> bool:
        """Return whether this is more than may be held."""
        return 0 < self.keyframes < keyframes or 0 < self.megabytes < nbytes / 1e6
