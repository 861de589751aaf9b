# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Topics and messages of a ROS 2 bag folder, a single .mcap or .db3 file, or a ROS 1 .bag file.

The package rosbags is imported when the first bag is opened.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError


def topics(bag: Path, types: tuple[str, ...]) -> dict[str, int]:
    """
    Return the topics of the given message types with their message counts, sorted by name.

    :param bag: path of the bag.
    :param types: message types, such as 'sensor_msgs/msg/Image'.
    :raises PlaceRecognitionError: the bag is missing, empty, truncated or corrupt, or the package
        rosbags is not installed.
    """
    with _open(bag) as reader:
        counts: dict[str, int] = {}
        for connection in reader.connections:
            if connection.msgtype in types:
                counts[connection.topic] = counts.get(connection.topic, 0) + connection.msgcount
    return dict(sorted(counts.items()))


def choose_topic(
    bag: Path, topic: str | None, types: tuple[str, ...], flag: str
) -> tuple[str, int]:
    """
    Return the name and the message count of the requested topic.

    :param bag: path of the bag.
    :param topic: the requested topic; None selects the only topic of these types.
    :param types: message types that the topic may have.
    :param flag: command-line flag that selects the topic, for error messages.
    :raises PlaceRecognitionError: no topic of these types, several topics and none requested, or
        the topic has no messages. The message lists the available topics as flags to copy.
    """
    counts = topics(bag, types)
    type_names = ' or '.join(name.rpartition('/')[2] for name in types)
    if not counts:
        raise PlaceRecognitionError(f'bag {bag} has no topic of type {type_names}')
    choices = ' | '.join(f'{flag} {name}' for name in counts)
    if topic is None and len(counts) > 1:
        raise PlaceRecognitionError(
            f'bag {bag} has {len(counts)} {type_names} topics; use {choices}'
        )
    chosen = topic or next(iter(counts))
    if chosen not in counts:
        raise PlaceRecognitionError(f'bag {bag} has no {type_names} topic {chosen}; use {choices}')
    if not counts[chosen]:
        raise PlaceRecognitionError(f'bag {bag}: topic {chosen} has no messages; record it again')
    return chosen, counts[chosen]


@dataclass(frozen=True)
class StoredMessage:
    """
    A serialized message of a bag.

    :param where: bag, topic and 1-based message number, for error messages.
    :param recorded_ns: time at which the message was recorded.
    """

    where: str
    recorded_ns: int
    _reader: Any
    _msgtype: str
    _data: bytes

    def decode(self) -> Any:
        """
        Return the deserialized message.

        :raises PlaceRecognitionError: the bytes do not match the message type.
        """
        try:
            return self._reader.deserialize(self._data, self._msgtype)
        except Exception as error:  # generated parsers raise many types of exceptions
            raise PlaceRecognitionError(
                f'{self.where}: {len(self._data)} bytes are no {self._msgtype}: {_one_line(error)}'
            ) from error


def messages(bag: Path, topic: str) -> Generator[StoredMessage, None, None]:
    """
    Yield the messages of a topic in the order of the bag.

    :raises PlaceRecognitionError: the bag is damaged, or the package rosbags is not installed.
    """
    with _open(bag) as reader:
        chosen = [connection for connection in reader.connections if connection.topic == topic]
        entries = reader.messages(chosen)
        for number in count(1):
            with _read_errors(bag):
                entry = next(entries, None)
            if entry is None:
                return
            connection, recorded_ns, data = entry
            where = f'bag {bag}, topic {topic}, message {number}'
            yield StoredMessage(where, recorded_ns, reader, connection.msgtype, data)


@contextmanager
def _open(bag: Path) -> Iterator[Any]:
    """Open a bag for reading; the context value is a rosbags AnyReader."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import get_typestore, Stores
    except ImportError as error:
        raise PlaceRecognitionError(
            f'bag {bag}: the package rosbags is not installed; `pip install rosbags`'
        ) from error
    with _read_errors(bag):
        reader = AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY))
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


@contextmanager
def _read_errors(bag: Path) -> Iterator[None]:
    """Convert every exception that rosbags raises on damaged bytes to a one-line error."""
    try:
        yield
    except Exception as error:
        raise PlaceRecognitionError(
            f'bag {bag} cannot be read: {_one_line(error)}; `ros2 bag reindex` or '
            '`mcap recover` may repair a truncated bag'
        ) from error


def _one_line(error: Exception) -> str:
    return ' '.join(str(error).split()).rstrip('.') or type(error).__name__
