# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Reads the storage format sqlite3 of rosbag2 (.db3)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import sqlite3
from urllib.parse import quote

from hdc_place_recognition.datasets.bag_storage import Topic

MAGIC = b'SQLite format 3\0'


class SqliteStorage:
    """
    An open .db3 file.

    Messages in a write-ahead log (-wal) beside the file are read too.

    :raises sqlite3.Error: the file is damaged.
    :raises ValueError: tables are missing.
    """

    def __init__(self, path: Path) -> None:
        log = path.with_name(path.name + '-wal')
        # `immutable` needs no write access to the folder, but ignores a write-ahead log.
        mode = 'mode=ro' if log.is_file() and log.stat().st_size else 'mode=ro&immutable=1'
        self._database = sqlite3.connect(
            f'file:{quote(str(path.absolute()))}?{mode}', uri=True, check_same_thread=False
        )
        self._database.text_factory = lambda text: text.decode('utf-8', 'replace')
        try:
            self.topics = self._read_topics()
        except BaseException:
            self.close()
            raise

    def messages(self, keys: set[int]) -> Iterator[tuple[Topic, int, bytes]]:
        """Yield the serialized messages of topics by the time at which they were received."""
        by_key = {topic.key: topic for topic in self.topics}
        marks = ', '.join('?' * len(keys))
        rows = self._database.execute(
            f'SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) '
            'ORDER BY timestamp, id',
            sorted(keys),
        )
        for key, recorded_ns, data in rows:
            if not isinstance(data, bytes):
                raise ValueError(f'a message is a {type(data).__name__} instead of bytes')
            yield by_key[key], recorded_ns, data

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def _read_topics(self) -> list[Topic]:
        tables = {
            name for (name,) in self._database.execute('SELECT name FROM sqlite_master '
                                                       "WHERE type = 'table'")
        }  # fmt: skip
        if not {'topics', 'messages'} <= tables:
            raise ValueError('it has no tables of topics and messages')
        counts = dict(
            self._database.execute('SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id')
        )
        rows = self._database.execute('SELECT id, name, type, serialization_format FROM topics')
        return [
            Topic(key, str(name), str(msgtype), str(serialization), counts.get(key, 0))
            for key, name, msgtype, serialization in rows
            if isinstance(key, int)
        ]
