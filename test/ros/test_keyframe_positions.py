# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Positions of keyframes from odometry."""

import math
from time import perf_counter

from hdc_place_recognition.recognition.keyframes import Pose
from hdc_place_recognition.ros.keyframe_positions import KeyframePositions

MS = 1_000_000
AHEAD = (0.0, 0.0, 0.0, 1.0)


def at(x: float, z: float = 0.0) -> Pose:
    return Pose((x, 0.0, z), AHEAD)


def positions(*stamps_ms: int) -> KeyframePositions:
    found = KeyframePositions(tolerance_ns=100 * MS)
    for stamp in stamps_ms:
        found.add_odometry(stamp * MS, at(float(stamp), 1.0))
    return found


def test_nearest_by_stamp():
    found = positions(0, 50, 100)
    found.add_keyframe(0, 60 * MS)
    found.add_keyframe(1, 80 * MS)
    assert found.position(0) == (50.0, 0.0, 1.0)
    assert found.position(1) == (100.0, 0.0, 1.0)


def test_later_odometry_may_be_nearer():
    found = positions(0)
    found.add_keyframe(0, 60 * MS)
    assert found.position(0)[0] == 0.0
    found.add_odometry(70 * MS, at(70.0))
    assert found.position(0)[0] == 70.0


def test_settled_positions_stay_when_the_history_has_gone():
    found = positions(0)
    found.add_keyframe(7, 40 * MS)
    for stamp in range(200, 4000):
        found.add_odometry(stamp * MS, at(float(stamp)))
    assert found.position(7) == (0.0, 0.0, 1.0)


def test_keyframe_before_the_first_odometry():
    found = positions()
    found.add_keyframe(0, 60 * MS)
    assert math.isnan(found.position(0)[0])
    found.add_odometry(50 * MS, at(50.0))
    found.add_odometry(500 * MS, at(500.0))
    assert found.position(0)[0] == 50.0


def test_unknown_where_there_is_none_near():
    found = positions(0)
    found.add_keyframe(0, 101 * MS)
    assert all(math.isnan(value) for value in found.position(0))
    assert math.isnan(found.position(99)[0])
    silent = KeyframePositions(tolerance_ns=MS)
    silent.add_keyframe(0, 0)
    assert math.isnan(silent.position(0)[0])


def test_evicted_keyframes_have_no_position():
    found = positions(0, 50, 100)
    found.add_keyframe(3, 60 * MS)
    known = found.position(3)
    assert found.position(3) == known and known[0] == known[0]
    found.evict(3)
    assert found.position(3)[0] != found.position(3)[0]


def test_pose_before_looks_at_nothing_later():
    found = positions(0, 50, 100)
    assert found.pose_before(99 * MS) == at(50.0, 1.0)
    assert found.pose_before(100 * MS) == found.pose_before(200 * MS) == at(100.0, 1.0)
    assert found.pose_before(-1) is None and found.pose_before(201 * MS) is None


def play(found: KeyframePositions, first: int, last: int, offset: float) -> None:
    """Publish odometry at 20 Hz from one millisecond to another."""
    for stamp in range(first, last, 50):
        found.add_odometry(stamp * MS, at(stamp + offset))


def test_sessions_do_not_mix_when_odometry_is_set_back_first():
    found = positions()
    play(found, 0, 2000, 0.0)
    count = found.count
    found.add_keyframe(0, 1990 * MS)
    play(found, 0, 150, 1e6)
    found.begin_session(20 * MS, count, found.count)
    found.add_keyframe(1, 20 * MS)
    assert found.pose_before(20 * MS) == at(1e6)
    play(found, 150, 2000, 1e6)
    assert found.position(0)[0] == 1950.0
    assert found.position(1)[0] == 1e6


def test_sessions_do_not_mix_when_images_are_set_back_first():
    found = positions()
    play(found, 0, 2000, 0.0)
    found.begin_session(20 * MS, found.count, found.count)
    found.add_keyframe(1, 20 * MS)
    play(found, 2000, 2150, 0.0)
    assert found.pose_before(20 * MS) is None
    assert math.isnan(found.position(1)[0])
    play(found, 0, 2000, 1e6)
    assert found.position(1)[0] == 1e6


def test_images_without_odometry_of_their_session_have_no_position():
    found = positions()
    play(found, 0, 2000, 0.0)
    found.begin_session(500 * MS, found.count, found.count)
    found.add_keyframe(1, 500 * MS)
    assert math.isnan(found.position(1)[0]) and found.pose_before(500 * MS) is None


def test_stamps_of_the_camera_alone_are_set_back():
    found = positions()
    play(found, 0, 2000, 0.0)
    found.begin_session(2000 * MS, found.count, found.count)
    found.add_keyframe(1, 2010 * MS)
    play(found, 2000, 4000, 0.0)
    assert found.position(1)[0] == 2000.0


def test_odometry_that_goes_on_is_used_again():
    found = positions()
    play(found, 0, 5000, 0.0)
    # Images that are seconds late, and whose clock was set back.
    found.begin_session(2000 * MS, found.count, found.count)
    play(found, 5000, 16_000, 0.0)
    found.add_keyframe(1, 16_010 * MS)
    play(found, 16_000, 130_000, 0.0)
    assert found.position(1)[0] == 16_000.0


def test_keyframes_that_odometry_never_passes_do_not_slow_it_down():
    found = positions(0)
    for keyframe_id in range(50_000):
        found.add_keyframe(keyframe_id, (10**9 + keyframe_id) * MS)
    start = perf_counter()
    play(found, 50, 50_000, 0.0)
    # 999 messages, most of them in microseconds; they took 42 ms each.
    assert perf_counter() - start < 1.0


def test_evicted_keyframes_leave_nothing_behind():
    found = positions(0)
    for keyframe_id in range(10_000):
        found.add_keyframe(keyframe_id, (10**9 + keyframe_id) * MS)
        found.evict(keyframe_id)
    assert len(found._heap) < 5000 and not found._waiting
