# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Topics and messages of bags; every count is checked against what the bag announces."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

from hdc_place_recognition.datasets.bag_files import Bag, decoder, one_line, open_bag, read_errors
from hdc_place_recognition.errors import PlaceRecognitionError

_decoder = cache(decoder)


def topics(bag: Path, types: tuple[str, ...]) -> dict[str, int]:
    """
    Return the topics of the given message types with their message counts, sorted by name.

    :param bag: path of the bag.
    :param types: message types, such as 'sensor_msgs/msg/Image'.
    :raises PlaceRecognitionError: the bag is missing, empty, truncated or corrupt, its
        metadata.yaml announces another number of messages, or the package rosbags is not
        installed.
    """
    with open_bag(bag) as opened:
        counts: dict[str, int] = {}
        for topic in opened.topics:
            if topic.msgtype in types:
                counts[topic.name] = counts.get(topic.name, 0) + topic.count
        for name, found in counts.items():
            _check_announced(opened, name, found)
    return dict(sorted(counts.items()))


def _check_announced(bag: Bag, name: str, found: int) -> None:
    if bag.announced is not None and (announced := bag.announced.get(name, 0)) != found:
        raise PlaceRecognitionError(
            f'bag {bag.path}, topic {name}: metadata.yaml announces {announced} messages, but the '
            f'files hold {found}; `ros2 bag reindex` writes a new metadata.yaml'
        )


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
    _decode: Callable[[bytes, str], Any]
    _msgtype: str
    _data: bytes

    def decode(self) -> Any:
        """
        Return the deserialized message.

        :raises PlaceRecognitionError: the bytes do not match the message type.
        """
        try:
            return self._decode(self._data, self._msgtype)
        except Exception as error:  # generated parsers raise many types of exceptions
            raise PlaceRecognitionError(
                f'{self.where}: {len(self._data)} bytes are no {self._msgtype}: {one_line(error)}'
            ) from error


def messages(bag: Path, topic: str) -> Generator[StoredMessage, None, None]:
    """
    Yield the messages of a topic in the order of the bag.

    :raises PlaceRecognitionError: the bag is damaged, holds fewer or more messages than its index
        announces, or the package rosbags is not installed.
    """
    with open_bag(bag) as opened:
        announced = sum(item.count for item in opened.topics if item.name == topic)
        entries = opened.messages(topic)
        for number in count(1):
            with read_errors(bag):
                entry = next(entries, None)
                if entry is None and number - 1 != announced:
                    raise ValueError(
                        f'topic {topic} has {number - 1} messages, but the index announces '
                        f'{announced}'
                    )
            if entry is None:
                return
            item, recorded_ns, data = entry
            where = f'bag {bag}, topic {topic}, message {number}'
            yield StoredMessage(where, recorded_ns, _decoder(opened.ros1), item.msgtype, data)
