# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Where the memory for hypervectors comes from."""

from __future__ import annotations

from mmap import MADV_DONTNEED, MADV_RANDOM, mmap
import os
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Protocol

from hdc_place_recognition.errors import PlaceRecognitionError
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


# Each map holds a file descriptor, so that there should be few; disk is taken only as it is used.
_MAP_BYTES = 256 << 20
_PAGE_BYTES = 4096


class RowFile:
    """
    Room on a disk: a file without a name, which is gone when nobody uses it, however that ends.

    :param folder: on the disk.
    :raises PlaceRecognitionError: no file can be made there.
    """

    resident = False

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        try:
            self._file = TemporaryFile(dir=folder)  # noqa: SIM115
        except OSError as error:
            raise PlaceRecognitionError(
                f'rows_folder {folder}: {error.strerror}; name a folder that can be written to'
            ) from error
        self._maps: list[mmap] = []
        self._end = 0
        self._given_back: list[NDArray[Any]] = []

    def take(self, rows: int, dimensions: int, kind: np.dtype[Any]) -> NDArray[Any]:
        """
        Return a matrix of any content.

        :raises PlaceRecognitionError: the disk is full.
        """
        if self._given_back:
            return self._given_back.pop()
        size = -(-rows * dimensions * kind.itemsize // _PAGE_BYTES) * _PAGE_BYTES
        start = self._end
        if start % _MAP_BYTES + size > _MAP_BYTES or not self._maps:
            start = len(self._maps) * _MAP_BYTES
        try:
            # Writing to a map of what the disk has no room for would end the program.
            os.posix_fallocate(self._file.fileno(), start, size)
            if start == len(self._maps) * _MAP_BYTES:
                self._maps.append(self._new_map(start))
        except OSError as error:
            raise PlaceRecognitionError(
                f'rows_folder {self._folder}: {error.strerror} for {size / 1e6:.0f} MB after '
                f'{start / 1e6:.0f} MB; make room there, or set max_keyframes'
            ) from error
        self._end = start + size
        matrix = np.frombuffer(self._maps[-1], kind, rows * dimensions, start % _MAP_BYTES)
        return matrix.reshape(rows, dimensions)

    def give_back(self, matrix: NDArray[Any]) -> None:
        """Take a matrix that nobody uses any more, to be taken again."""
        self._given_back.append(matrix)

    def rest(self) -> None:
        """Let go of the pages in memory: they are in the file, and found there again."""
        for each in self._maps:
            each.madvise(MADV_DONTNEED)

    def _new_map(self, start: int) -> mmap:
        os.ftruncate(self._file.fileno(), start + _MAP_BYTES)
        made = mmap(self._file.fileno(), _MAP_BYTES, offset=start)
        made.madvise(MADV_RANDOM)
        return made
