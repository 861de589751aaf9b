# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What the storage of every bag format gives: topics with counts, and serialized messages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

# The largest message or chunk that is decompressed; a damaged size may claim any number.
LARGEST_BYTES = 2**29
ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'


@dataclass(frozen=True)
class Topic:
    """
    A topic of a storage file; a bag can hold several with the same name.

    :param key: identifies it in its file.
    :param serialization: how messages are serialized; 'cdr' or 'ros1' can be read.
    :param count: number of messages that the index of the file announces.
    """

    key: int
    name: str
    msgtype: str
    serialization: str
    count: int


class Storage(Protocol):
    """An open storage file."""

    topics: list[Topic]

    def messages(self, keys: set[int]) -> Iterator[tuple[Topic, int, bytes]]:
        """Yield topics, times of recording (ns) and serialized messages, by these times."""

    def close(self) -> None:
        """Close the file."""


def decompress_zstd(data: bytes, limit: int = LARGEST_BYTES) -> bytes:
    """
    Return decompressed data.

    :raises ValueError: the result is larger than the limit, or the data are cut short.
    """
    decompressor = zstd_decompressor()
    content: bytes = decompressor.decompress(data, max_length=limit + 1)
    if len(content) > limit or not decompressor.eof:
        raise ValueError(f'compressed data are cut short or hold more than {limit} bytes')
    return content


def zstd_decompressor() -> Any:
    """Return a decompressor; rosbags depends on one of these packages."""
    try:
        from compression import zstd
    except ImportError:
        from backports import zstd
    return zstd.ZstdDecompressor()
