# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A bag through hdc_evaluate and, message by message, through the node: the same candidates."""

from __future__ import annotations

from collections.abc import Iterator
import csv
from pathlib import Path
import time

import cv2
from hdc_place_recognition.cli import evaluate
import numpy as np
from numpy.typing import NDArray
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

rclpy = pytest.importorskip('rclpy', reason='needs ROS')

from hdc_place_recognition.conversions.image import stamp_ns  # noqa: E402, I100
from hdc_place_recognition.ros.messages import PublishedCandidate, read_candidates  # noqa: E402
from hdc_place_recognition.ros.node import PlaceRecognitionNode  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.serialization import deserialize_message  # noqa: E402
from sensor_msgs.msg import Image, PointCloud2  # noqa: E402

STORE = get_typestore(Stores.ROS2_JAZZY)
TOPIC = '/camera/image_raw'
START_NS = 1_776_863_762_100_071_637
SETTINGS = {'extractor': 'gradient_grid', 'exclude_recent_s': 4.0, 'top_k': 5, 'n_x': 3}


def camera() -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Yield a camera that goes round a texture twice, at 10 Hz with jitter."""
    rng = np.random.default_rng(0)
    scene = cv2.GaussianBlur(rng.integers(0, 256, (120, 900), dtype=np.uint8), (0, 0), 3)
    scene = np.hstack([scene, scene[:, :160]])
    scene = cv2.normalize(scene, None, 0, 255, cv2.NORM_MINMAX)
    for index in range(150):
        columns = np.arange(160) + index * 12 % 900
        noise = rng.integers(0, 9, (120, 160), dtype=np.uint8)
        yield (
            START_NS + index * 100_000_000 + int(rng.integers(0, 30_000_000)),
            scene[:, columns] // 2 + noise,
        )


def write_bag(path: Path, storage: StoragePlugin) -> list[bytes]:
    kinds = STORE.types
    raws = []
    with Writer(path, version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection(TOPIC, 'sensor_msgs/msg/Image', typestore=STORE)
        for now_ns, image in camera():
            stamp = kinds['builtin_interfaces/msg/Time'](*divmod(now_ns, 10**9))
            header = kinds['std_msgs/msg/Header'](stamp, 'camera')
            message = kinds['sensor_msgs/msg/Image'](
                header, *image.shape, 'mono8', 0, image.shape[1], image.ravel()
            )
            raws.append(bytes(STORE.serialize_cdr(message, 'sensor_msgs/msg/Image')))
            writer.write(connection, now_ns + 5_000_000, raws[-1])
    return raws


def ask_node(raws: list[bytes]) -> tuple[list[PublishedCandidate], int]:
    rclpy.init(args=[])
    words = [word for name, value in SETTINGS.items() for word in ('-p', f'{name}:={value}')]
    node, listener = PlaceRecognitionNode(cli_args=['--ros-args', *words]), Node('listener')
    heard: list[PointCloud2] = []
    listener.create_subscription(
        PointCloud2, '/place_recognition_node/candidates', heard.append, 1000
    )
    executor = SingleThreadedExecutor()
    executor.add_node(listener)
    while not node.count_subscribers('/place_recognition_node/candidates'):
        executor.spin_once(timeout_sec=0.1)
    for raw in raws:
        node._on_image(deserialize_message(raw, Image))
        assert node.worker.wait_idle(10.0)
    end = time.monotonic() + 10.0
    while len(heard) < node.statistics.processed and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    assert len(heard) == node.statistics.processed
    assert [stamp_ns(message) for message in heard] == sorted(map(stamp_ns, heard))
    executor.shutdown()
    listener.destroy_node()
    node.destroy_node()
    rclpy.try_shutdown()
    return [item for message in heard for item in read_candidates(message)], len(heard)


@pytest.mark.parametrize('storage', [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_same_candidates(tmp_path, storage):
    raws = write_bag(tmp_path / 'bag', storage)
    flags = [
        word
        for name, value in SETTINGS.items()
        for word in ('--' + name.replace('_', '-'), str(value))
    ]
    output = tmp_path / 'results'
    assert evaluate.main([str(tmp_path / 'bag'), '--output', str(output), *flags]) == 0
    with (output / 'bag_1' / 'candidates.csv').open() as file:
        offline = list(csv.DictReader(file))
    online, answers = ask_node(raws)
    # About every third image is admitted, and there is something to compare.
    assert 50 < answers < 100 and len(online) > 150
    assert any(item.candidate.accepted for item in online)
    assert len(offline) == len(online)
    for row, item in zip(offline, online, strict=True):
        found = item.candidate
        assert int(row['query_stamp_ns']) == found.query_stamp_ns
        assert int(row['match_stamp_ns']) == found.match_stamp_ns
        assert int(row['match_id']) == found.match_id
        assert float(row['similarity']) == pytest.approx(found.similarity, abs=1e-6)
