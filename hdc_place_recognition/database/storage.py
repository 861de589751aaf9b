# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Where the memory for hypervectors comes from: RAM, or an anonymous file on a disk."""

from __future__ import annotations

from mmap import MADV_DONTNEED, MADV_RANDOM, mmap
import os
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Protocol

from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray

# Each map holds a file descriptor, so there should be few; the disk is filled as it is used.
_MAP_BYTES = 256 << 20
_PAGE_BYTES = 4096


class VectorStorage(Protocol):
    """Allocates matrices for hypervectors."""

    @property
    def resident(self) -> bool:
        """Return whether the matrices lie in the memory of the process."""

    def allocate(self, rows: int, dimensions: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """
        Return a matrix (rows, dimensions) of arbitrary content.

        :raises PlaceRecognitionError: there is no room for it.
        """

    def release(self, matrix: NDArray[Any]) -> None:
        """Take back a matrix that is no longer used."""

    def drop_pages(self) -> None:
        """Free memory that only caches what is stored elsewhere."""


class RamStorage:
    """The memory of the process; the system assigns a page when it is first written."""

    resident = True

    def allocate(self, rows: int, dimensions: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return a matrix of arbitrary content."""
        return np.empty((rows, dimensions), dtype)

    def release(self, matrix: NDArray[Any]) -> None:
        """Do nothing: the matrix is freed with its last reference."""

    def drop_pages(self) -> None:
        """Do nothing: the matrices are stored nowhere else."""


class FileStorage:
    """
    Memory-mapped anonymous temporary file; the OS deletes it on exit or crash.

    :param folder: folder on a disk.
    :raises PlaceRecognitionError: no file can be created there.
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
        self._free: list[NDArray[Any]] = []

    def allocate(self, rows: int, dimensions: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """
        Return a matrix of arbitrary content.

        :raises PlaceRecognitionError: the disk is full.
        """
        if self._free:
            return self._free.pop()
        size = -(-rows * dimensions * dtype.itemsize // _PAGE_BYTES) * _PAGE_BYTES
        start = self._end
        if start % _MAP_BYTES + size > _MAP_BYTES or not self._maps:
            start = len(self._maps) * _MAP_BYTES
        try:
            # Without this, writing to a map of a full disk would kill the process (SIGBUS).
            os.posix_fallocate(self._file.fileno(), start, size)
            if start == len(self._maps) * _MAP_BYTES:
                self._maps.append(self._new_map(start))
        except OSError as error:
            raise PlaceRecognitionError(
                f'rows_folder {self._folder}: {error.strerror} for {size / 1e6:.0f} MB after '
                f'{start / 1e6:.0f} MB; make room there, or set max_keyframes'
            ) from error
        self._end = start + size
        matrix = np.frombuffer(self._maps[-1], dtype, rows * dimensions, start % _MAP_BYTES)
        return matrix.reshape(rows, dimensions)

    def release(self, matrix: NDArray[Any]) -> None:
        """Keep the matrix for the next call of :meth:`allocate`."""
        self._free.append(matrix)

    def drop_pages(self) -> None:
        """Free the pages in memory; their content stays in the file."""
        for mapped in self._maps:
            mapped.madvise(MADV_DONTNEED)

    def _new_map(self, start: int) -> mmap:
        os.ftruncate(self._file.fileno(), start + _MAP_BYTES)
        mapped = mmap(self._file.fileno(), _MAP_BYTES, offset=start)
        mapped.madvise(MADV_RANDOM)
        return mapped
