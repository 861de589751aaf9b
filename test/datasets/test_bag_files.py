# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Bags as recorders and tools really leave them."""

import os
import shutil
import sqlite3

from bag_messages import (
    CAMERA,
    image,
    images_bag,
    odometry,
    S,
    START,
    STORE1,
    write_bag,
)
from hdc_place_recognition.datasets import bag_files, bag_mcap, bags
from hdc_place_recognition.datasets.bag_reader import messages, topics
from hdc_place_recognition.errors import PlaceRecognitionError
from mcap_files import channel, mcap, message, ros_message, schema
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

STAMPS = [START + number * S for number in range(3)]
IMAGE = 'sensor_msgs/msg/Image'


def stamps(bag, **options):
    return [frame.stamp_ns for frame in bags.BagImages.from_bag(bag, **options)]


def storage_file(bag):
    """Return the only storage file of a bag folder."""
    (file,) = (path for path in bag.iterdir() if path.suffix != '.yaml')
    return file


def edit_metadata(bag, old, new):
    file = bag / 'metadata.yaml'
    content = file.read_text()
    assert old in content
    file.write_text(content.replace(old, new))


@pytest.mark.parametrize('plugin', list(StoragePlugin))
@pytest.mark.parametrize('compression', [None, *CompressionMode])
def test_agrees_with_rosbags(tmp_path, plugin, compression):
    if (plugin, compression) == (StoragePlugin.SQLITE3, CompressionMode.STORAGE):
        pytest.skip('sqlite3 has no such compression')
    writer = Writer(tmp_path / 'bag', version=9, storage_plugin=plugin)
    if compression not in (None, CompressionMode.NONE):
        writer.set_compression(compression, CompressionFormat.ZSTD)
    store = get_typestore(Stores.ROS2_JAZZY)
    with writer:
        for topic in ('/b', '/a'):
            connection = writer.add_connection(topic, IMAGE, typestore=store)
            for number in range(40):
                # Large enough for several chunks of MCAP, received in another order.
                sent = image(START + number, number, size=100_000)
                writer.write(connection, S + number * 7 % 40, store.serialize_cdr(sent, IMAGE))
    with AnyReader([tmp_path / 'bag'], default_typestore=store) as reader:
        chosen = [item for item in reader.connections if item.topic == '/a']
        expected = [bytes(data) for _, _, data in reader.messages(chosen)]
    assert topics(tmp_path / 'bag', (IMAGE,)) == {'/a': 40, '/b': 40}
    found = [bytes(stored._data) for stored in messages(tmp_path / 'bag', '/a')]
    assert found == expected


@pytest.mark.parametrize(
    'records',
    [
        [
            schema(9, 'own/srv/Sum_Event', definition=b'int64 a\n---\nint64 b\n'),
            channel(9, 9, '/x'),
        ],
        [schema(9, 'own/msg/Text', definition=b'\xff\xfe\x80'), channel(9, 9, '/x')],
        [schema(9, 'Status', 'jsonschema', b'{}'), channel(9, 9, '/x', 'json')],
        [schema(9, 'own.Log', 'protobuf', b'\x0a\x00'), channel(9, 9, '/x', 'protobuf')],
        [schema(9, '\xe9'.encode('latin-1'), '', b''), channel(9, 9, b'/\xff')],
        [channel(9, 0, '/without_schema', 'json')],
        [],
    ],
    ids=['service event', 'not UTF-8', 'JSON', 'protobuf', 'names', 'no schema', 'nothing'],
)
@pytest.mark.parametrize('profile', ['ros2', ''])
def test_a_foreign_topic_does_not_matter(tmp_path, records, profile):
    own = [schema(1, IMAGE, '', b''), channel(1, 1, CAMERA)]
    own += [ros_message(1, stamp, image(stamp)) for stamp in STAMPS]
    foreign = [*records, message(9, START, b'{}')] if records else []
    file = mcap(tmp_path / 'drive.mcap', foreign + own, profile)
    assert stamps(file) == STAMPS


def test_standard_types_are_known_whatever_the_definitions_say(tmp_path):
    records = [schema(1, IMAGE, 'ros2msg', b'string nonsense'), channel(1, 1, CAMERA)]
    records.append(ros_message(1, START, image(START)))
    assert stamps(mcap(tmp_path / 'drive.mcap', records)) == [START]


QOS = (
    '- history: 3\n  depth: 0\n  reliability: 1\n  durability: 2\n  liveliness: 1\n'
    '  deadline: {{sec: {0}, nsec: {0}}}\n  lifespan: {{sec: {0}, nsec: {0}}}\n'
    '  liveliness_lease_duration: {{sec: {0}, nsec: {0}}}\n'
    '  avoid_ros_namespace_conventions: false'
)


@pytest.mark.parametrize('content', [QOS.format(0), QOS.format(2147483647), '{[', '', '\xff'])
def test_the_qos_in_the_file_does_not_matter(tmp_path, content):
    bag = images_bag(tmp_path / 'bag', STAMPS)
    with sqlite3.connect(storage_file(bag)) as database:
        database.execute('UPDATE topics SET offered_qos_profiles = ?', (content,))
    assert stamps(bag) == STAMPS


def test_the_qos_differs_between_the_files_of_a_split_bag(tmp_path):
    bag = images_bag(tmp_path / 'bag', STAMPS[:2])
    rest = storage_file(images_bag(tmp_path / 'rest', STAMPS[2:]))
    with sqlite3.connect(rest) as database:
        database.execute('UPDATE topics SET offered_qos_profiles = ?', (QOS.format(1),))
    shutil.copy(rest, bag / 'bag_1.db3')
    edit_metadata(bag, '- bag.db3', '- bag.db3\n  - bag_1.db3')
    edit_metadata(bag, 'message_count: 2', 'message_count: 3')
    assert stamps(bag) == STAMPS


@pytest.mark.parametrize('identifier', ['""', 'my_storage', 'mcap'])
def test_the_format_is_told_by_the_content(tmp_path, identifier):
    bag = images_bag(tmp_path / 'bag', STAMPS)
    edit_metadata(bag, 'storage_identifier: sqlite3', f'storage_identifier: {identifier}')
    assert stamps(bag) == STAMPS


@pytest.mark.parametrize('name', ['run #3', 'run 100%25', 'what?', 'a&mode=rw', "it's", 'ü'])
@pytest.mark.parametrize('plugin', list(StoragePlugin))
def test_any_path(tmp_path, name, plugin):
    images_bag(tmp_path / 'bag', STAMPS, plugin).rename(tmp_path / name)
    assert stamps(tmp_path / name) == STAMPS


def test_messages_in_a_write_ahead_log(tmp_path):
    bag = images_bag(tmp_path / 'bag', STAMPS)
    file = storage_file(bag)
    connection = sqlite3.connect(file)
    connection.execute('PRAGMA journal_mode = WAL')
    data = connection.execute('SELECT data FROM messages').fetchall()[-1][0]
    connection.execute('INSERT INTO messages VALUES (99, 1, 9000000000, ?)', (data,))
    connection.commit()
    # As after a crash of the recorder: the log was not merged.
    crashed = tmp_path / 'crashed.db3'
    shutil.copy(file, crashed)
    shutil.copy(f'{file}-wal', f'{crashed}-wal')
    connection.close()
    assert topics(crashed, (IMAGE,)) == {CAMERA: 4}
    assert len(list(messages(crashed, CAMERA))) == 4


def test_compressed_messages_in_a_single_file(tmp_path):
    for plugin in StoragePlugin:
        writer = Writer(tmp_path / plugin.name, version=9, storage_plugin=plugin)
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
        store = get_typestore(Stores.ROS2_JAZZY)
        with writer:
            connection = writer.add_connection(CAMERA, IMAGE, typestore=store)
            for stamp in STAMPS:
                writer.write(connection, stamp, store.serialize_cdr(image(stamp), IMAGE))
        assert stamps(storage_file(tmp_path / plugin.name)) == STAMPS


def compressed_file(folder):
    """Return a single file that is compressed as a whole."""
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.FILE, CompressionFormat.ZSTD)
    store = get_typestore(Stores.ROS2_JAZZY)
    with writer:
        connection = writer.add_connection(CAMERA, IMAGE, typestore=store)
        for stamp in STAMPS:
            writer.write(connection, stamp, store.serialize_cdr(image(stamp), IMAGE))
    return storage_file(folder)


def test_a_compressed_single_file(tmp_path):
    file = compressed_file(tmp_path / 'bag')
    assert file.suffix == '.zstd'
    assert stamps(file) == stamps(tmp_path / 'bag') == STAMPS
    file.write_bytes(file.read_bytes()[:-20])
    with pytest.raises(PlaceRecognitionError, match='cut short'):
        stamps(file)


def test_a_compressed_file_does_not_fill_the_disk(tmp_path, monkeypatch):
    file = compressed_file(tmp_path / 'bag')
    monkeypatch.setattr(bag_files, '_SPARE_BYTES', 2**60)
    with pytest.raises(PlaceRecognitionError, match=r'no space for it; decompress it \(zstd -d\)'):
        stamps(file)


@pytest.mark.parametrize('found', [2, 4])
def test_metadata_that_announces_another_count(tmp_path, found):
    bag = images_bag(tmp_path / 'bag', STAMPS)
    edit_metadata(bag, 'message_count: 3', f'message_count: {found}')
    with pytest.raises(
        PlaceRecognitionError,
        match=rf'topic {CAMERA}: metadata.yaml announces {found} messages, but .* hold 3; .*index',
    ):
        stamps(bag)


def test_an_index_that_announces_another_count(tmp_path):
    file = storage_file(images_bag(tmp_path / 'bag', STAMPS, StoragePlugin.MCAP))
    content = file.read_bytes()
    counts = content.rindex(b'\x0b' + (56).to_bytes(8, 'little')) + 9 + 46
    assert content[counts : counts + 10] == b'\x01\0\x03\0\0\0\0\0\0\0'
    file.write_bytes(content[: counts + 2] + b'\x05' + content[counts + 3 :])
    with pytest.raises(PlaceRecognitionError, match='has 3 messages, but the index announces 5'):
        stamps(file)


def test_a_damaged_database_index_is_not_silent(tmp_path):
    bag = images_bag(tmp_path / 'bag', STAMPS)
    with sqlite3.connect(storage_file(bag)) as database:
        database.execute('DROP INDEX timestamp_idx')
        database.execute('CREATE INDEX timestamp_idx ON messages (timestamp) WHERE timestamp = 0')
    assert stamps(bag) == STAMPS


@pytest.mark.parametrize(
    ('name', 'content', 'remedy'),
    [
        ('cut.mcap', bag_mcap.MAGIC + bytes(500), 'mcap recover'),
        ('cut.db3', b'SQLite format 3\0' + bytes(500), r'sqlite3 FILE \.recover'),
        ('cut.bag', b'#ROSBAG V2.0\n' + bytes(500), 'rosbag reindex'),
        ('empty.mcap', b'', 'is empty'),
        ('text.db3', b'hello', 'is no bag file'),
    ],
)
def test_the_remedy_fits_the_format(tmp_path, name, content, remedy):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(PlaceRecognitionError, match=rf'{name} cannot be read: .*{remedy}'):
        stamps(tmp_path / name)


def test_a_pipe_is_not_a_bag(tmp_path):
    os.mkfifo(tmp_path / 'drive.mcap')
    with pytest.raises(PlaceRecognitionError, match='not a regular file'):
        stamps(tmp_path / 'drive.mcap')


def test_a_view_instead_of_a_table_is_not_read(tmp_path):
    with sqlite3.connect(tmp_path / 'view.db3') as database:
        database.execute('CREATE TABLE topics (id, name, type, serialization_format)')
        database.execute(
            'CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i FROM n) '
            'SELECT i AS id, i AS topic_id, i AS timestamp, i AS data FROM n'
        )
    with pytest.raises(PlaceRecognitionError, match='no tables of topics and messages'):
        stamps(tmp_path / 'view.db3')


def test_odometry_of_an_old_ros1_bag(tmp_path):
    path = tmp_path / 'old.bag'
    types = STORE1.types
    kind = 'geometry_msgs/msg/PoseStamped'
    sent = odometry(START, 2.0)
    header = types['std_msgs/msg/Header'](0, image(START, store=STORE1).header.stamp, 'map')
    position = types['geometry_msgs/msg/Point'](2.0, 0.0, 0.0)
    turned = types['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0)
    pose = types['geometry_msgs/msg/Pose'](position, turned)
    with Writer1(path) as writer:
        connection = writer.add_connection('/truth', kind, typestore=STORE1)
        content = STORE1.serialize_ros1(types[kind](header, pose), kind)
        writer.write(connection, 5 * S, content)
    poses = bags.read_poses(path, '/truth')
    np.testing.assert_array_equal(poses.positions, [[sent.pose.pose.position.x, 0, 0]])


def test_a_bag_is_closed_when_the_reader_stops_early(tmp_path):
    bag = write_bag(tmp_path / 'bag', [(CAMERA, image(stamp)) for stamp in STAMPS])
    reader = messages(bag, CAMERA)
    next(reader)
    reader.close()
    assert stamps(bag) == STAMPS


def test_a_topic_with_a_line_break_in_its_name_is_one_line(tmp_path):
    records = [schema(1, IMAGE), channel(1, 1, '/a\nb'), channel(2, 1, '/c\r')]
    with pytest.raises(PlaceRecognitionError, match=r'use --topic /a b \| --topic /c') as caught:
        bags.BagImages.from_bag(mcap(tmp_path / 'drive.mcap', records))
    assert len(str(caught.value).splitlines()) == 1
