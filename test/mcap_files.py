# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Writes MCAP files record by record, as tests need them."""

import struct

from bag_messages import STORE

MAGIC = b'\x89MCAP0\r\n'


def text(content):
    """Return a string or bytes with its length."""
    content = content.encode() if isinstance(content, str) else content
    return struct.pack('<I', len(content)) + content


def record(kind, *fields):
    """Return a record of a type."""
    body = b''.join(fields)
    return bytes([kind]) + struct.pack('<Q', len(body)) + body


def schema(key, name, encoding='ros2msg', definition=b''):
    return record(3, struct.pack('<H', key), text(name), text(encoding), text(definition))


def channel(key, schema_key, topic, serialization='cdr'):
    ids = struct.pack('<HH', key, schema_key)
    return record(4, ids, text(topic), text(serialization), text(b''))


def message(key, stamp, data):
    return record(5, struct.pack('<HIQQ', key, 0, stamp, stamp), data)


def ros_message(key, stamp, content):
    """Return a record with a serialized ROS 2 message."""
    return message(key, stamp, bytes(STORE.serialize_cdr(content, content.__msgtype__)))


def mcap(path, records, profile='ros2'):
    """Write a file without index; return its path."""
    start = record(1, text(profile), text('test'))
    end = record(15, bytes(4)) + record(2, bytes(20))
    path.write_bytes(MAGIC + start + b''.join(records) + end + MAGIC)
    return path
