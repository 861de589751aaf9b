# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Reads the storage format MCAP, see https://mcap.dev/spec.

Schemas are only names here: a topic with a schema that is damaged or in another language than
ROS 2 messages does not matter to the topics that are read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
import heapq
from itertools import count
from pathlib import Path
import struct
from typing import BinaryIO
import zlib

from hdc_place_recognition.datasets.bag_storage import decompress_zstd, LARGEST_BYTES, Topic

MAGIC = b'\x89MCAP0\r\n'
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x02, 0x03, 0x04, 0x05, 0x06
_CHUNK_INDEX, _STATISTICS, _DATA_END = 0x08, 0x0B, 0x0F
_HEAD = struct.Struct('<BQ')
_FOOTER_BODY = struct.Struct('<QQI')
_END_BYTES = _HEAD.size + _FOOTER_BODY.size + len(MAGIC)
_LARGEST_INDEX = 2**28


@dataclass(frozen=True)
class _Chunk:
    """Entry of the index: position of the chunk record, and the channels in it."""

    start_time: int
    position: int
    channels: frozenset[int]


class McapStorage:
    """
    An open .mcap file.

    The index at the end of the file is used if it is complete, otherwise the file is scanned.

    :raises ValueError, struct.error: the file is damaged.
    """

    def __init__(self, path: Path) -> None:
        self._file: BinaryIO = path.open('rb')
        try:
            self._end = self._file.seek(0, 2) - _END_BYTES
            self._schemas: dict[int, str] = {}
            self._channels: dict[int, Topic] = {}
            self._chunks: list[_Chunk] = []
            counts = self._read_index() or self._count_by_scan()
            self.topics = [
                replace(topic, count=counts.get(key, 0)) for key, topic in self._channels.items()
            ]
        except BaseException:
            self.close()
            raise

    def messages(self, keys: set[int]) -> Iterator[tuple[Topic, int, bytes]]:
        """Yield the serialized messages of topics by the time at which they were received."""
        by_key = {topic.key: topic for topic in self.topics}
        if not self._chunks:
            for recorded_ns, key, data in self._scan(keys):
                yield by_key[key], recorded_ns, data
            return
        waiting: list[tuple[int, int, int, bytes]] = []
        order = count()
        for chunk in sorted(self._chunks, key=lambda chunk: (chunk.start_time, chunk.position)):
            if chunk.channels and not chunk.channels & keys:
                continue
            # No later chunk has messages from before its start.
            while waiting and waiting[0][0] < chunk.start_time:
                recorded_ns, _, key, data = heapq.heappop(waiting)
                yield by_key[key], recorded_ns, data
            for stamp, key, data in self._messages_at(chunk.position, keys):
                heapq.heappush(waiting, (stamp, next(order), key, data))
        while waiting:
            recorded_ns, _, key, data = heapq.heappop(waiting)
            yield by_key[key], recorded_ns, data

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _read_index(self) -> dict[int, int]:
        """Read the index; return the number of messages by channel, empty if it says nothing."""
        self._file.seek(0)
        start = self._file.read(len(MAGIC))
        if start != MAGIC or self._end < len(MAGIC):
            raise ValueError('it does not start as an MCAP file')
        self._file.seek(self._end)
        end = self._file.read(_END_BYTES)
        if not end.endswith(MAGIC) or end[0] != _FOOTER:
            raise ValueError('its end is missing')
        summary, _, checksum = _FOOTER_BODY.unpack_from(end, _HEAD.size)
        if not summary:
            return {}
        if not len(MAGIC) <= summary <= self._end or self._end - summary > _LARGEST_INDEX:
            raise ValueError('its index is damaged')
        self._file.seek(summary)
        index = self._file.read(self._end - summary)
        if checksum and zlib.crc32(index + end[: _HEAD.size + 16]) != checksum:
            raise ValueError('its index is damaged: wrong checksum')
        counts = self._parse_index(index)
        return counts if set(counts) <= set(self._channels) else {}

    def _parse_index(self, index: bytes) -> dict[int, int]:
        """Take schemas, channels and chunks from the index; return the counts by channel."""
        counts: dict[int, int] = {}
        for kind, record in _records(index):
            self._define(kind, record)
            if kind == _CHUNK_INDEX:
                self._chunks.append(_chunk(record))
            elif kind == _STATISTICS:
                counts = dict(struct.iter_unpack('<HQ', _Fields(record, 42).block()))
        return counts

    def _count_by_scan(self) -> dict[int, int]:
        """Return the number of messages by channel; the channels are found on the way."""
        self._chunks = []
        counts: dict[int, int] = {}
        for _, key, _ in self._scan(None):
            counts[key] = counts.get(key, 0) + 1
        return counts

    def _define(self, kind: int, record: bytes) -> None:
        """Take a schema or a channel."""
        if kind == _SCHEMA:
            (key,) = struct.unpack_from('<H', record)
            self._schemas[key] = _Fields(record, 2).text()
        elif kind == _CHANNEL:
            key, schema = struct.unpack_from('<HH', record)
            fields = _Fields(record, 4)
            name, serialization = fields.text(), fields.text()
            self._channels[key] = Topic(key, name, self._schemas.get(schema, ''), serialization, 0)

    def _scan(self, keys: set[int] | None) -> Iterator[tuple[int, int, bytes]]:
        """Yield time, channel and data of messages in the order of the file; None for all."""
        position = len(MAGIC)
        while position < self._end:
            self._file.seek(position)
            kind, length = _HEAD.unpack(self._file.read(_HEAD.size))
            if position + _HEAD.size + length > self._end:
                raise ValueError(f'the record at byte {position} is cut short')
            if kind == _DATA_END:
                return
            if kind in (_SCHEMA, _CHANNEL):
                self._define(kind, self._file.read(length))
            elif kind == _MESSAGE:
                yield from _wanted(self._file.read(length), keys)
            elif kind == _CHUNK:
                yield from self._messages_at(position, keys)
            position += _HEAD.size + length

    def _messages_at(
        self, position: int, keys: set[int] | None
    ) -> Iterator[tuple[int, int, bytes]]:
        """Yield time, channel and data of the messages of the chunk at a position."""
        self._file.seek(position)
        kind, length = _HEAD.unpack(self._file.read(_HEAD.size))
        if kind != _CHUNK or position + _HEAD.size + length > self._end:
            raise ValueError(f'there is no whole chunk at byte {position}')
        for kind, record in _records(_decompressed(self._file.read(length))):
            if kind == _MESSAGE:
                yield from _wanted(record, keys)
            else:
                self._define(kind, record)


def _wanted(record: bytes, keys: set[int] | None) -> Iterator[tuple[int, int, bytes]]:
    """Yield time, channel and data of a message record, if its channel is wanted."""
    key, _, stamp, _ = struct.unpack_from('<HIQQ', record)
    if keys is None or key in keys:
        yield stamp, key, record[22:]


def _chunk(record: bytes) -> _Chunk:
    start_time, _, position, _ = struct.unpack_from('<QQQQ', record)
    channels = frozenset(key for key, _ in struct.iter_unpack('<HQ', _Fields(record, 32).block()))
    return _Chunk(start_time, position, channels)


def _decompressed(record: bytes) -> bytes:
    """Return the records of a chunk."""
    size, checksum = struct.unpack_from('<QI', record, 16)
    if size > LARGEST_BYTES:
        raise ValueError(f'a chunk claims {size} bytes; the limit is {LARGEST_BYTES}')
    fields = _Fields(record, 28)
    compression = fields.text()
    (length,) = struct.unpack_from('<Q', record, fields.position)
    packed = record[fields.position + 8 : fields.position + 8 + length]
    content = _unpack(packed, compression, size)
    if len(content) != size or (checksum and zlib.crc32(content) != checksum):
        raise ValueError('a chunk is damaged: wrong size or checksum')
    return content


def _unpack(packed: bytes, compression: str, size: int) -> bytes:
    if compression == 'zstd':
        return decompress_zstd(packed, size)
    if compression == 'lz4':
        import lz4.frame

        content: bytes = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
        return content
    if compression:
        raise ValueError(f'a chunk is compressed by {compression!r}, not by zstd or lz4')
    return packed


def _records(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield type and body of records."""
    position = 0
    while position < len(content):
        kind, length = _HEAD.unpack_from(content, position)
        position += _HEAD.size
        if position + length > len(content):
            raise ValueError('a record is cut short')
        yield kind, content[position : position + length]
        position += length


class _Fields:
    """Reads fields of variable length one after the other."""

    def __init__(self, record: bytes, position: int) -> None:
        self._record, self.position = record, position

    def block(self) -> bytes:
        """Return the next block of bytes."""
        (length,) = struct.unpack_from('<I', self._record, self.position)
        start = self.position + 4
        self.position = start + length
        if self.position > len(self._record):
            raise ValueError('a field is cut short')
        return self._record[start : self.position]

    def text(self) -> str:
        """Return the next text; bytes that are not UTF-8 are replaced."""
        return self.block().decode('utf-8', 'replace')
