# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Where the memory for hypervectors comes from."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


class Room(Protocol):
    """Gives memory for matrices, and takes it back."""

    @property
    def resident(self) -> bool:
        """Return whether it is the process's own memory."""

    def take(self, rows: int, dimensions: int, kind: np.dtype[Any]) -> NDArray[Any]:
        """
        Return a matrix of any content.

        :raises PlaceRecognitionError: there is no room for it.
        """

    def give_back(self, matrix: NDArray[Any]) -> None:
        """Take a matrix that nobody uses any more."""

    def rest(self) -> None:
        """Let go of memory that was only looked at."""


class Memory:
    """The process's own memory; what was never written is not taken from the system."""

    resident = True

    def take(self, rows: int, dimensions: int, kind: np.dtype[Any]) -> NDArray[Any]:
        """Return a matrix of any content."""
        return np.empty((rows, dimensions), kind)

    def give_back(self, matrix: NDArray[Any]) -> None:
        """Do nothing: it goes with the last reference."""

    def rest(self) -> None:
        """Do nothing: what was looked at is in memory anyway."""
