# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Positions of keyframes from odometry."""

import math

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
