# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The node in this process, with real topics, parameters and messages."""

from __future__ import annotations

from collections.abc import Iterator

from conftest import texture
import cv2
import pytest

rclpy = pytest.importorskip('rclpy', reason='needs ROS')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402, I100
from hdc_place_recognition.ros.messages import read_candidates  # noqa: E402
from hdc_place_recognition.ros.parameters import unknown_overrides  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import qos_profile_sensor_data  # noqa: E402
from ros_bench import Bench, NAME, parameter, S, set_stamp, SOON_S, start_ros  # noqa: E402
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2  # noqa: E402


@pytest.fixture(autouse=True)
def ros(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    start_ros(monkeypatch)
    yield
    rclpy.try_shutdown()


@pytest.fixture
def bench() -> Iterator[Bench]:
    found = Bench()
    yield found
    found.close()


def test_loop_is_published_with_the_images_header(bench):
    candidates = bench.heard(PointCloud2, NAME + '/candidates')
    closures = bench.heard(PointCloud2, NAME + '/loop_closures')
    bench.until(lambda: bench.node.count_subscribers(NAME + '/loop_closures'))
    for second, place in enumerate([*range(10), 3]):
        odometry = Odometry()
        set_stamp(odometry, second + 0.01)
        odometry.pose.pose.position.x = float(second)
        bench.odometry.publish(odometry)
        bench.until(lambda second=second: len(bench.node._positions._recent) > second)
        bench.show(second, texture(place))
    bench.until(lambda: len(candidates) == 11 and closures)
    assert [len(read_candidates(message)) for message in candidates[:6]] == [0, 0, 0, 0, 0, 1]
    assert len(closures) == 1
    header = closures[0].header
    assert (header.stamp.sec, header.stamp.nanosec, header.frame_id) == (10, 0, 'camera')
    best = read_candidates(closures[0])[0]
    assert best.candidate.match_stamp_ns == 3 * S and best.candidate.accepted
    assert best.candidate.similarity == pytest.approx(1, abs=1e-5)
    assert best.position == (3.0, 0.0, 0.0)
    assert all(item.candidate.accepted for item in read_candidates(closures[0]))


def test_calibration_is_taken_and_a_bad_one_is_none(bench):
    calibration = bench.user.create_publisher(CameraInfo, '/camera/camera_info', 10)
    bench.until(lambda: bench.node.count_publishers('/camera/camera_info'))
    bench.until(lambda: calibration.get_subscription_count())
    message = CameraInfo(width=64, height=48, k=[50.0, 0, 32, 0, 50, 24, 0, 0, 1])
    calibration.publish(message)
    bench.until(lambda: bench.node.recognizer.traverse().camera)
    assert bench.node.recognizer.traverse().camera.fits(48 / 64)
    message.k = [0.0] * 9
    calibration.publish(message)
    bench.until(lambda: bench.node.recognizer.traverse().camera is None)


def test_live_parameter_is_set_and_a_bad_one_refused_with_a_reason(bench):
    good = parameter(bench, 'set_parameters', [Parameter('min_score', value=0.25)])
    assert good.results[0].successful
    assert bench.node.recognizer.params.min_score == 0.25
    whole = parameter(bench, 'set_parameters', [Parameter('min_score', value=1)])
    assert whole.results[0].successful
    assert bench.node.recognizer.params.min_score == 1.0
    for name, value, reason in [
        ('min_score', 1.5, 'min_score'),
        ('min_score', 2, 'outside 0 to 1'),
        ('min_score', 'high', 'expected a float'),
        ('n_x', 3, 'read-only'),
    ]:
        bad = parameter(bench, 'set_parameters', [Parameter(name, value=value)]).results[0]
        assert not bad.successful
        assert reason in bad.reason
    assert bench.node.recognizer.params.min_score == 1.0


def test_parameters_are_described(bench):
    described = parameter(bench, 'describe_parameters', ['min_score', 'extractor', 'top_k'])
    similarity, extractor, top_k = described.descriptors
    assert 'Probability' in similarity.description and not similarity.read_only
    assert similarity.floating_point_range[0].to_value == 1.0
    assert extractor.read_only and 'sift' in extractor.additional_constraints
    assert top_k.integer_range[0].from_value == 1


def test_bad_images_are_counted_and_the_node_goes_on(bench):
    bench.show(0, None, height=1000)
    bench.show(1, None, encoding='mono7')
    bench.show(2, None)
    bench.show(2, None)
    bench.show(1.5, None)
    bench.show(2.1, None)
    values = bench.node._values()
    assert values['images received'] == '6' and values['images processed'] == '1'
    assert values['images refused'] == '2' and 'mono7' in values['last error']
    assert values['images skipped: same stamp as the last image'] == '1'
    assert values['images skipped: older than the last image'] == '1'
    assert values['database keyframes'] == '1'


def test_what_is_skipped_is_not_decoded(bench, monkeypatch):
    decoded = []
    converter = bench.node._converter
    convert = converter.convert
    monkeypatch.setattr(
        converter, 'convert', lambda message: decoded.append(message) or convert(message)
    )
    for second in (0, 0.1, 0.15, 0.2):
        bench.show(second, None)
    assert len(decoded) == bench.node.statistics.processed == 2


def test_an_unexpected_error_does_not_end_the_node(bench, monkeypatch):
    def fail(message: object) -> None:
        raise ZeroDivisionError('of all things')

    with monkeypatch.context() as patch:
        patch.setattr(bench.node._converter, 'convert', fail)
        bench.show(0, None)
    bench.show(1, None)
    values = bench.node._values()
    assert values['last error'] == 'ZeroDivisionError: of all things'
    assert values['images processed'] == '1'


def test_simulation_time_set_back(bench):
    for second, place in [*((60 + place, place) for place in range(8)), (0, 2)]:
        bench.show(second, texture(place))
    assert bench.node.statistics.accepted >= 1
    assert bench.node.statistics.processed == 9


def test_diagnostics_once_a_second(bench):
    heard = bench.heard(DiagnosticArray, '/diagnostics')
    bench.show(0, None)
    bench.until(lambda: heard)
    status = heard[-1].status[0]
    values = {pair.key: pair.value for pair in status.values}
    assert status.name == '/place_recognition_node: place recognition'
    assert status.level == DiagnosticStatus.OK
    assert status.message == 'no keyframe is old enough to be compared with'
    assert values['images processed'] == '1' and values['features'] == 'cells'
    assert int(values['database bytes']) > 4096 * 4 and float(values['ms extract']) > 0


def test_silence_is_explained(bench):
    bench.node._input._last -= 7.0
    problem = bench.node._input.problem()
    assert problem == 'no image on /camera/image_raw for 7 s, publishers: 1'
    heard = bench.heard(DiagnosticArray, '/diagnostics')
    bench.until(lambda: heard)
    assert heard[-1].status[0].level == DiagnosticStatus.WARN
    assert 'no image on /camera/image_raw' in heard[-1].status[0].message


def test_incompatible_quality_of_service_is_named(bench):
    publisher = Node('other_camera')
    publisher.create_publisher(Image, '/camera/image_raw', qos_profile_sensor_data)
    bench.until(lambda: bench.node.count_publishers('/camera/image_raw') == 2)
    bench.node._input._last -= 7.0
    problem = bench.node._input.problem()
    assert 'publishers: 2; /other_camera has incompatible QoS' in problem and 'eliab' in problem
    publisher.destroy_node()


def test_publisher_of_another_type_is_named(bench, monkeypatch):
    # One process cannot publish two types on a topic; another one can, and nothing arrives.
    bench.until(lambda: bench.node.count_publishers('/camera/image_raw') == 1)
    (info,) = bench.node.get_publishers_info_by_topic('/camera/image_raw')
    info.topic_type = 'sensor_msgs/msg/CompressedImage'
    monkeypatch.setattr(bench.node, 'get_publishers_info_by_topic', lambda topic: [info])
    bench.node._input._last -= 7.0
    assert bench.node._input.problem().endswith(
        '/user publishes sensor_msgs/msg/CompressedImage, not sensor_msgs/msg/Image: '
        'see the parameter image_transport'
    )


def test_unknown_parameters_are_named():
    bench = Bench('-p', 'min_similarty:=0.5', '-p', 'use_sim_time:=false')
    assert unknown_overrides(bench.node) == ['min_similarty']
    bench.close()


def test_quality_of_service_can_be_overridden():
    bench = Bench('-p', 'qos_overrides./camera/image_raw.subscription.depth:=3')
    assert bench.node._input._subscription.profile.depth == 3
    bench.close()


def test_compressed_images():
    bench = Bench('-p', 'image_transport:=compressed')
    images = bench.user.create_publisher(CompressedImage, '/camera/image_raw/compressed', 10)
    for second in range(2):
        _, jpeg = cv2.imencode('.jpg', texture(second))
        # The second one is cut short.
        message = CompressedImage(format='mono8; jpeg compressed', data=jpeg.tobytes())
        message.data = message.data[: len(message.data) // (second + 1)]
        set_stamp(message, second)
        images.publish(message)
        bench.until(lambda second=second: bench.node.statistics.received > second)
        assert bench.node.worker.wait_idle(SOON_S)
    assert bench.node.statistics.processed == 1
    assert 'cannot be decoded' in bench.node.statistics.last_error
    bench.close()
