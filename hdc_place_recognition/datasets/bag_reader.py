# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Topics and messages of rosbags: a ROS 2 bag folder, a bare .mcap or .db3, a ROS 1 .bag."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores


def topics(bag: Path, types: tuple[str, ...]) -> dict[str, int]:
    """
    Return the topics of some message types and how many messages each has, sorted by name.

    :param bag: path of the bag.
    :param types: message types, as 'sensor_msgs/msg/Image'.
    :raises PlaceRecognitionError: the bag is missing, empty, truncated or corrupt.
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
    Return the topic asked for, or the only one of its types, and how many messages it has.

    :param bag: path of the bag.
    :param topic: the one that the user asked for, None for the only one.
    :param types: its possible message types.
    :param flag: the flag by which users choose, for the message.
    :raises PlaceRecognitionError: there is none, there are several to choose from, or it has no
        messages; names all there are in a form to be copied.
    """
    there = topics(bag, types)
    names = ' or '.join(name.rpartition('/')[2] for name in types)
    if not there:
        raise PlaceRecognitionError(f'bag {bag} has no topic of type {names}; nothing to read')
    choices = ' | '.join(f'{flag} {name}' for name in there)
    if topic is None and len(there) > 1:
        raise PlaceRecognitionError(f'bag {bag} has {len(there)} {names} topics; use {choices}')
    chosen = topic or next(iter(there))
    if chosen not in there:
        raise PlaceRecognitionError(f'bag {bag} has no {names} topic {chosen}; use {choices}')
    if not there[chosen]:
        raise PlaceRecognitionError(f'bag {bag}: topic {chosen} has no messages; record it again')
    return chosen, there[chosen]


@dataclass(frozen=True)
class StoredMessage:
    """
    A message as the bag holds it.

    :param where: bag, topic and number of the message in the topic from 1 on, for messages.
    """

    where: str
    _reader: AnyReader
    _msgtype: str
    _data: bytes

    def decode(self) -> Any:
        """
        Return the message deserialized.

        :raises PlaceRecognitionError: its bytes are not of its type.
        """
        try:
            return self._reader.deserialize(self._data, self._msgtype)
        except Exception as error:  # whatever the generated parser stumbles over
            raise PlaceRecognitionError(
                f'{self.where}: {len(self._data)} bytes are no {self._msgtype}: {_one_line(error)}'
            ) from error


def messages(bag: Path, topic: str) -> Generator[StoredMessage, None, None]:
    """
    Yield the messages of a topic.

    :raises PlaceRecognitionError: the bag is damaged.
    """
    with _open(bag) as reader:
        chosen = [connection for connection in reader.connections if connection.topic == topic]
        stored = reader.messages(chosen)
        for number in count(1):
            with _reading(bag):
                following = next(stored, None)
            if following is None:
                return
            connection, _, data = following
            where = f'bag {bag}, topic {topic}, message {number}'
            yield StoredMessage(where, reader, connection.msgtype, data)


@contextmanager
def _open(bag: Path) -> Iterator[AnyReader]:
    with _reading(bag):
        reader = AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY))
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


@contextmanager
def _reading(bag: Path) -> Iterator[None]:
    """Turn whatever rosbags and its parsers raise over damaged bytes into one line."""
    try:
        yield
    except Exception as error:
        raise PlaceRecognitionError(
            f'bag {bag} cannot be read: {_one_line(error)}; one that was cut off can perhaps be '
            'repaired by `ros2 bag reindex` or `mcap recover`'
        ) from error


def _one_line(error: Exception) -> str:
    return ' '.join(str(error).split()).rstrip('.') or type(error).__name__
