# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The node on a robot: names, QoS, parameters, and inputs that are wrong."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from conftest import ROOT, texture
import pytest
import yaml

rclpy = pytest.importorskip('rclpy', reason='needs ROS')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402, I100
from hdc_place_recognition.errors import PlaceRecognitionError  # noqa: E402
from hdc_place_recognition.ros.messages import read_candidates  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import (  # noqa: E402
    DurabilityPolicy,
    qos_profile_sensor_data,
    QoSProfile,
    ReliabilityPolicy,
)
from ros_bench import Bench, image_message, NAME, parameter, S, set_stamp, start_ros  # noqa: E402
from sensor_msgs.msg import CameraInfo, Image, PointCloud2  # noqa: E402

AUTO = ('-p', 'image_qos:=auto')
LATCHED = QoSProfile(
    depth=1,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    reliability=ReliabilityPolicy.RELIABLE,
)


@pytest.fixture(autouse=True)
def ros(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    start_ros(monkeypatch)
    yield
    rclpy.try_shutdown()


@pytest.fixture
def benches() -> Iterator[Any]:
    """Return a function that starts a node with some words of the command line."""
    started = []

    def start(*words: str) -> Bench:
        started.append(Bench(*words))
        return started[-1]

    yield start
    for bench in started:
        bench.close()


@pytest.fixture
def bench(benches: Any) -> Bench:
    return benches()


def reliability(bench: Bench) -> ReliabilityPolicy:
    return bench.node._input._subscription.profile.reliability


def status(bench: Bench) -> Any:
    """Return the next status on /diagnostics."""
    heard = bench.heard(DiagnosticArray, '/diagnostics')
    bench.until(lambda: heard)
    return heard[-1].status[0]


def drive(bench: Bench, offset: float) -> None:
    """Show eight places, each with odometry at the x of its second plus an offset."""
    for second in range(8):
        odometry = Odometry()
        set_stamp(odometry, second)
        odometry.pose.pose.position.x = second + offset
        count = bench.node._positions.count
        bench.odometry.publish(odometry)
        bench.until(lambda count=count: bench.node._positions.count > count)
        bench.show(second, texture(second))


@pytest.mark.parametrize(('second', 'nanosec'), [(1, 4 * S), (2**31 - 1, S), (-5, 0)])
def test_a_stamp_out_of_range_is_refused_and_the_node_goes_on(bench, second, nanosec):
    message = image_message(1, texture(1))
    message.header.stamp.sec, message.header.stamp.nanosec = second, nanosec
    bench.images.publish(message)
    bench.until(lambda: bench.node.statistics.failed)
    assert f'{second} seconds and {nanosec} nanoseconds' in bench.node.statistics.last_error
    bench.show(1, texture(1))
    assert bench.node.statistics.processed == 1


def test_an_error_while_publishing_is_counted_and_the_node_goes_on(bench, monkeypatch):
    def fail(message: object) -> None:
        raise OverflowError('Python integer out of bounds')

    with monkeypatch.context() as patch:
        patch.setattr(bench.node._candidates, 'publish', fail)
        bench.show(0, texture(0))
    found = status(bench)
    assert found.level == DiagnosticStatus.WARN
    assert 'could not be published: OverflowError' in found.message
    heard = bench.heard(PointCloud2, NAME + '/candidates')
    bench.until(lambda: bench.node.count_subscribers(NAME + '/candidates'))
    bench.show(1, texture(1))
    bench.until(lambda: heard)
    assert bench.node._values()['answers not published'] == '1'


def test_odometry_that_is_not_finite_is_refused_and_named(bench):
    message = Odometry()
    message.pose.pose.position.x = float('nan')
    bench.odometry.publish(message)
    bench.until(lambda: 'refused' in bench.node._odometry.state)
    message.pose.pose.position.x, message.header.stamp.nanosec = 0.0, 2 * S
    bench.odometry.publish(message)
    bench.until(lambda: '2 refused' in bench.node._odometry.state)
    assert bench.node._positions.count == 0
    assert 'nanoseconds' in bench.node._values()['odometry']


def test_images_without_stamps_get_the_time_of_arrival(bench):
    heard = bench.heard(PointCloud2, NAME + '/candidates')
    bench.until(lambda: bench.node.count_subscribers(NAME + '/candidates'))
    parameter(bench, 'set_parameters', [Parameter('exclude_recent_s', value=0.0)])
    parameter(bench, 'set_parameters', [Parameter('min_interval_s', value=0.0)])
    for place in range(4):
        bench.show(0, texture(place))
    bench.until(lambda: len(heard) == 4)
    newest = read_candidates(heard[-1])[0].candidate
    assert abs(newest.query_stamp_ns - bench.node.get_clock().now().nanoseconds) < 60 * S


def test_a_bag_played_twice_gets_positions_of_the_right_session(bench):
    heard = bench.heard(PointCloud2, NAME + '/candidates')
    bench.until(lambda: bench.node.count_subscribers(NAME + '/candidates'))
    for lap in range(2):
        drive(bench, 1000.0 * lap)
    bench.until(lambda: len(heard) == 16)
    found = [item for message in heard for item in read_candidates(message)]
    assert {item.candidate.query_session for item in found} == {0, 1}
    again = [item for item in found if item.candidate.query_session == 1]
    assert len(again) > 10 and any(item.candidate.accepted for item in again)
    for item in found:
        candidate = item.candidate
        offset = 1000.0 * candidate.match_session
        assert item.position[0] == candidate.match_stamp_ns / S + offset
    assert bench.node._values()['session'] == '1'


def test_reliability_follows_the_publishers(benches):
    bench = benches(*AUTO)
    assert reliability(bench) == ReliabilityPolicy.RELIABLE
    bench.show(0, texture(0))
    other = Node('other_camera')
    unreliable = other.create_publisher(Image, '/camera/image_raw', qos_profile_sensor_data)
    bench.until(lambda: reliability(bench) == ReliabilityPolicy.BEST_EFFORT)
    assert '(best effort)' in bench.node._values()['image topic']
    bench.until(unreliable.get_subscription_count)
    unreliable.publish(image_message(1, texture(1)))
    bench.until(lambda: bench.node.statistics.received == 2)
    other.destroy_node()
    bench.until(lambda: reliability(bench) == ReliabilityPolicy.RELIABLE)
    bench.until(bench.images.get_subscription_count)
    bench.show(2, texture(2))


def test_an_overridden_reliability_does_not_follow(benches):
    name = 'qos_overrides./camera/image_raw.subscription.'
    bench = benches(*AUTO, '-p', name + 'reliability:=best_effort', '-p', name + 'depth:=3')
    bench.node._input._subscription.match()
    assert reliability(bench) == ReliabilityPolicy.BEST_EFFORT
    assert bench.node._input._subscription.profile.depth == 3


def test_overrides_of_quality_of_service_are_no_unknown_parameters(benches, capfd):
    benches('-p', 'qos_overrides./odom.subscription.depth:=7', '-p', 'qos_overrides./x.y.z:=1')
    assert 'unknown parameters' not in capfd.readouterr().err


def test_a_bad_override_of_quality_of_service_is_named(benches):
    name = 'qos_overrides./camera/image_raw.subscription.reliability'
    with pytest.raises(PlaceRecognitionError, match=r'qos_overrides./camera.*`perfect`'):
        benches('-p', f'{name}:=perfect')


def test_lost_images_are_a_warning_with_a_remedy(bench):
    bench.show(0, texture(0))
    bench.node._input._on_lost(3)
    found = status(bench)
    assert found.level == DiagnosticStatus.WARN
    assert 'DDS has lost 3 of the last 4 images' in found.message
    assert 'large_images.xml' in found.message
    bench.node._input._last -= 7.0
    assert 'DDS has lost 3 images: make the publisher' in bench.node._input.problem()


def test_no_usable_image_is_a_warning(bench):
    bench.show(0, texture(0), encoding='mono7')
    assert 'none of the last 1 images was processed; 1 were refused' in status(bench).message
    bench.show(1, texture(0))
    assert status(bench).level == DiagnosticStatus.OK


def test_images_beyond_max_image_pixels_are_refused(benches):
    bench = benches('-p', 'max_image_pixels:=100')
    bench.show(0, texture(0))
    assert 'more than max_image_pixels = 100' in bench.node.statistics.last_error


def test_equal_stamps_are_a_warning(bench):
    bench.show(1, texture(0))
    bench.node._recent._before.clear()
    bench.node._recent._before.append(bench.node._recent._counts())
    bench.show(1, texture(1))
    bench.show(1, texture(2))
    found = status(bench)
    assert found.level == DiagnosticStatus.WARN
    assert '2 have the same header stamp as the image before' in found.message


def test_diagnostics_name_node_camera_and_inputs(benches):
    found = status(benches('-r', '__ns:=/robot1', '-r', '__node:=front'))
    assert found.name == '/robot1/front: place recognition'
    assert found.hardware_id == '/camera/image_raw'
    values = {pair.key: pair.value for pair in found.values}
    assert values['odometry'] == 'no message on /robot1/odom'
    assert values['camera_info'] == 'no message on /camera/camera_info'


def test_latched_camera_info_of_before_the_start_is_received(benches):
    driver = Node('driver')
    info = driver.create_publisher(CameraInfo, '/lens', LATCHED)
    info.publish(CameraInfo(width=64, height=48, k=[50.0, 0, 32, 0, 50, 24, 0, 0, 1]))
    bench = benches('-r', 'camera_info:=/lens')
    bench.until(lambda: bench.node.recognizer.traverse().camera)
    assert bench.node._values()['camera_info'] == 'calibrated'
    driver.destroy_node()


def test_an_uncalibrated_camera_is_told_once(bench, capfd):
    for _ in range(3):
        bench.node._camera_info._on_message(CameraInfo())
    assert capfd.readouterr().err.count('camera_info refused') == 1
    assert bench.node._values()['camera_info'].startswith('camera_info')


def test_the_name_of_compressed_images_may_be_given_in_full(benches):
    bench = benches('-p', 'image_transport:=compressed', '-r', 'image:=/camera/image/compressed')
    assert bench.node._camera_info.topic == '/camera/camera_info'
    assert bench.node._input.topic.count('compressed') == 1


def test_a_refused_value_does_not_change_the_type(bench):
    for value in ('high', 3):
        parameter(bench, 'set_parameters', [Parameter('min_score', value=value)])
    described = parameter(bench, 'describe_parameters', ['min_score']).descriptors[0]
    assert described.type == Parameter.Type.DOUBLE.value
    parameter(bench, 'set_parameters', [Parameter('min_score', value=1)])
    assert bench.node.get_parameter('min_score').type_ == Parameter.Type.DOUBLE


def test_an_integer_at_the_start_is_stored_as_float(benches):
    bench = benches('-p', 'min_score:=1')
    assert bench.node.get_parameter('min_score').type_ == Parameter.Type.DOUBLE


def test_every_value_of_the_shipped_file_can_be_loaded(benches):
    path = ROOT / 'config' / 'place_recognition.yaml'
    bench = benches('--params-file', str(path), '-p', 'image_qos:=auto')
    values = yaml.safe_load(path.read_text())['/**']['ros__parameters']
    loaded = [Parameter(name, value=value) for name, value in values.items()]
    results = parameter(bench, 'set_parameters', loaded).results
    assert [result.reason for result in results if not result.successful] == []
    changed = parameter(bench, 'set_parameters', [Parameter('n_x', value=3)]).results[0]
    assert 'n_x is read-only after the start; restart the node with -p n_x:=3' in changed.reason
