# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Opens bags: a ROS 2 bag folder, a single .mcap or .db3 file (also .zstd), or a ROS 1 .bag file.

The format of a file is told by its first bytes. The package rosbags reads ROS 1 bags and decodes
messages; it is imported when the first bag is opened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass
from pathlib import Path, PurePath
import shutil
import stat
import tempfile
from typing import Any, BinaryIO

from hdc_place_recognition.bounded_files import MIB, read_yaml
from hdc_place_recognition.datasets import bag_mcap, bag_sqlite
from hdc_place_recognition.datasets.bag_storage import (
    decompress_zstd,
    Storage,
    Topic,
    zstd_decompressor,
    ZSTD_MAGIC,
)
from hdc_place_recognition.errors import PlaceRecognitionError

_METADATA_BYTES = 16 * MIB
_SPARE_BYTES = 2**30  # of the temporary folder, not used for decompressed files
_ROS1_MAGIC = b'#ROSBAG V2.0'
_READABLE = {'cdr', 'ros1'}  # serialization formats
_OLD_NAMES = {'tf/msg/tfMessage': 'tf2_msgs/msg/TFMessage'}
_REMEDIES = {
    '.mcap': '`mcap recover` may repair a truncated file',
    '.bag': '`rosbag reindex` may repair a truncated ROS 1 bag',
    '.db3': '`sqlite3 FILE .recover` may repair the file, and `ros2 bag reindex` its folder',
}


@dataclass(frozen=True)
class Bag:
    """
    An open bag.

    :param storages: its files, in order.
    :param announced: number of messages by topic that metadata.yaml announces; None without it.
    :param ros1: whether it is a ROS 1 bag.
    """

    path: Path
    storages: list[Storage]
    announced: Mapping[str, int] | None
    ros1: bool

    @property
    def topics(self) -> list[Topic]:
        """Return the topics whose messages can be decoded, of all files."""
        return [
            topic
            for storage in self.storages
            for topic in storage.topics
            if topic.serialization in _READABLE
        ]

    def messages(self, name: str) -> Iterator[tuple[Topic, int, bytes]]:
        """
        Yield the serialized messages of a topic in the order of the bag.

        rosbag2 compresses messages without a note in the file. A compressed message starts with
        the magic number of zstd, which no serialized message does.
        """
        for storage in self.storages:
            keys = {
                topic.key
                for topic in storage.topics
                if topic.name == name and topic.serialization in _READABLE
            }
            if keys:
                for topic, recorded_ns, data in storage.messages(keys):
                    compressed = topic.serialization == 'cdr' and data[:4] == ZSTD_MAGIC
                    yield topic, recorded_ns, decompress_zstd(data) if compressed else data


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """
    Open a bag for reading.

    :raises PlaceRecognitionError: it is missing, empty, truncated or corrupt, or the package
        rosbags is not installed.
    """
    _require_rosbags(path)
    with ExitStack() as stack:
        with read_errors(path):
            if path.is_dir():
                files, announced = _read_metadata(path)
            else:
                files, announced = [path], None
            storages = []
            for file in files:
                storage = _open_storage(file, stack)
                stack.callback(storage.close)
                storages.append(storage)
        yield Bag(path, storages, announced, any(isinstance(s, _Ros1Storage) for s in storages))


@contextmanager
def read_errors(path: Path) -> Iterator[None]:
    """Convert every exception on damaged bytes to a one-line error with a remedy."""
    try:
        yield
    except PlaceRecognitionError as error:
        raise PlaceRecognitionError(f'bag {path} cannot be read: {error}') from error
    except Exception as error:
        raise PlaceRecognitionError(
            f'bag {path} cannot be read: {one_line(error)}; {_remedy(path)}'
        ) from error


def one_line(error: Exception) -> str:
    """Return the message of an exception on one line; its type if it has none."""
    return ' '.join(str(error).split()).rstrip('.') or type(error).__name__


def _remedy(path: Path) -> str:
    suffixes = {path.suffix}
    if path.is_dir():
        suffixes = {file.suffix for file in path.iterdir()}
    found = [remedy for suffix, remedy in _REMEDIES.items() if suffix in suffixes]
    return ', '.join(found) or 'give a bag folder, or a .mcap, .db3 or .bag file'


def _require_rosbags(path: Path) -> None:
    try:
        import rosbags.highlevel  # noqa: F401
    except ImportError as error:
        raise PlaceRecognitionError(
            f'bag {path}: the package rosbags is not installed; `pip install rosbags`'
        ) from error


def _read_metadata(folder: Path) -> tuple[list[Path], dict[str, int]]:
    """Return the files of a bag folder and the number of messages by topic."""
    content = read_yaml(folder / 'metadata.yaml', _METADATA_BYTES, 'metadata')
    try:
        information = content['rosbag2_bagfile_information']
        # Old versions write paths relative to the parent of the folder.
        names = [PurePath(name).name for name in information['relative_file_paths']]
        announced: dict[str, int] = {}
        for entry in information['topics_with_message_count']:
            name = str(entry['topic_metadata']['name'])
            announced[name] = announced.get(name, 0) + int(entry['message_count'])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise PlaceRecognitionError(
            f'metadata.yaml is not that of a bag ({error!r}); `ros2 bag reindex` writes a new one'
        ) from error
    return [folder / name for name in names], announced


def _open_storage(path: Path, stack: ExitStack) -> Storage:
    """Open a file by its first bytes; a compressed file is decompressed to a temporary folder."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise ValueError(f'{path} is not a regular file')
    with path.open('rb') as file:
        start = file.read(16)
    if start[:4] == ZSTD_MAGIC:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        path = _decompress(path, folder)
        with path.open('rb') as file:
            start = file.read(16)
    for magic, open_ in _FORMATS.items():
        if start.startswith(magic):
            return open_(path)
    raise ValueError(f'{path} is {"no bag file" if start else "empty"}')


def _decompress(path: Path, folder: Path) -> Path:
    """Return a decompressed copy of a file in a folder; the disk is not filled."""
    target = folder / 'storage'
    free = shutil.disk_usage(folder).free - _SPARE_BYTES
    decompressor = zstd_decompressor()
    with path.open('rb') as source, target.open('wb') as copy:
        while not decompressor.eof:
            packed = source.read(MIB) if decompressor.needs_input else b''
            if not packed and decompressor.needs_input:
                raise ValueError(f'{path.name} is cut short')
            _write(copy, decompressor.decompress(packed, max_length=MIB), free)
    return target


def _write(copy: BinaryIO, content: bytes, free: int) -> None:
    if copy.tell() + len(content) > free:
        raise ValueError(
            f'the temporary folder has no space for it; decompress it (zstd -d) on a larger disk '
            f'and set TMPDIR, {copy.tell()} bytes so far'
        )
    copy.write(content)


class _Ros1Storage:
    """An open ROS 1 bag."""

    def __init__(self, path: Path) -> None:
        from rosbags.rosbag1 import Reader

        self._reader = Reader(path)
        self._reader.open()
        self._connections = {item.id: item for item in self._reader.connections}
        self.topics = [
            Topic(
                item.id,
                item.topic,
                _OLD_NAMES.get(item.msgtype, item.msgtype),
                'ros1',
                item.msgcount,
            )
            for item in self._reader.connections
        ]

    def messages(self, keys: set[int]) -> Iterator[tuple[Topic, int, bytes]]:
        """Yield the serialized messages of topics by the time at which they were received."""
        by_key = {topic.key: topic for topic in self.topics}
        chosen = [self._connections[key] for key in sorted(keys)]
        for connection, recorded_ns, data in self._reader.messages(chosen):
            yield by_key[connection.id], recorded_ns, data

    def close(self) -> None:
        """Close the file."""
        self._reader.close()


_FORMATS: dict[bytes, Callable[[Path], Storage]] = {
    bag_sqlite.MAGIC: bag_sqlite.SqliteStorage,
    bag_mcap.MAGIC: bag_mcap.McapStorage,
    _ROS1_MAGIC: _Ros1Storage,
}


def decoder(ros1: bool) -> Callable[[bytes, str], Any]:
    """
    Return a function that decodes a message of a type.

    The standard definitions are used, not those in the bag: the types that are read here never
    changed, and definitions in bags are missing, damaged or in other languages.
    """
    from rosbags.typesys import get_typestore, Stores

    if ros1:
        return get_typestore(Stores.ROS1_NOETIC).deserialize_ros1
    return get_typestore(Stores.ROS2_JAZZY).deserialize_cdr
