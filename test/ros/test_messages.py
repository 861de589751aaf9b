# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Candidates as point clouds, and back."""

import struct

from hdc_place_recognition.results import Candidate, Reason
import pytest

pytest.importorskip('sensor_msgs', reason='needs ROS')
messages = pytest.importorskip('hdc_place_recognition.ros.messages', reason='needs ROS')

STAMP_NS = 1_776_863_762_100_071_637


def published(similarity: float = 0.5, *, accepted: bool = True) -> object:
    candidate = Candidate(
        query_stamp_ns=STAMP_NS,
        match_stamp_ns=STAMP_NS - 90_000_000_001,
        match_id=42,
        similarity=similarity,
        score=0.25,
        inliers=-1,
        accepted=accepted,
        reason=Reason.ACCEPTED if accepted else Reason.FEW_INLIERS,
        shift_x=-0.125,
        shift_y=0.5,
        rotation=(0.0, 0.5, -0.5, 0.25) if accepted else None,
        query_session=3,
        match_session=1,
    )
    return messages.PublishedCandidate(candidate, (1.5, -2.0, 0.25))


def message(*items: object) -> object:
    header = messages.Header(frame_id='camera')
    return messages.candidates_message(header, items)


def test_there_and_back_exactly():
    items = [published(0.75), published(0.5, accepted=False)]
    assert messages.read_candidates(message(*items)) == items


def test_layout_as_documented():
    cloud = message(published())
    names = [field.name for field in cloud.fields]
    assert names == [
        'x',
        'y',
        'z',
        'query_sec',
        'query_nanosec',
        'match_sec',
        'match_nanosec',
        'match_id',
        'similarity',
        'score',
        'inliers',
        'accepted',
        'shift_x',
        'shift_y',
        'reason',
        'qx',
        'qy',
        'qz',
        'qw',
        'query_session',
        'match_session',
    ]
    assert (cloud.height, cloud.width, cloud.point_step, cloud.row_step) == (1, 1, 84, 84)
    assert cloud.header.frame_id == 'camera' and not cloud.is_bigendian
    values = struct.unpack('<fffiIiIIffiB3xffB3xffffII', bytes(cloud.data))
    assert values == (
        1.5,
        -2.0,
        0.25,
        1776863762,
        100071637,
        1776863672,
        100071636,
        42,
        0.5,
        0.25,
        -1,
        1,
        -0.125,
        0.5,
        0,
        0.0,
        0.5,
        -0.5,
        0.25,
        3,
        1,
    )


def test_none_is_width_0():
    cloud = message()
    assert cloud.width == 0 and len(cloud.data) == 0 and len(cloud.fields) == 21
    assert messages.read_candidates(cloud) == []


def test_reader_follows_the_fields_not_the_layout():
    cloud = message(published())
    cloud.point_step = 88
    cloud.data = bytes(cloud.data) + bytes(4)
    assert messages.read_candidates(cloud) == [published()]


def test_survives_the_wire():
    serialization = pytest.importorskip('rclpy.serialization')
    raw = serialization.serialize_message(message(published()))
    again = serialization.deserialize_message(raw, type(message()))
    assert messages.read_candidates(again) == [published()]
