# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Poses from every type of message that gives them."""

from types import SimpleNamespace as Fields

from hdc_place_recognition.conversions.poses import PoseConverter
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
import pytest

S = 10**9


def header(sec, frame='map'):
    return Fields(stamp=Fields(sec=sec, nanosec=5), frame_id=frame)


def pose(x):
    return Fields(
        position=Fields(x=x, y=2.0, z=3.0), orientation=Fields(x=0.1, y=0.2, z=0.3, w=0.9)
    )


def transform(x, parent='map', child='base_link', sec=1):
    moved = Fields(translation=pose(x).position, rotation=pose(x).orientation)
    return Fields(header=header(sec, parent), child_frame_id=child, transform=moved)


def fix(latitude, longitude, altitude=200.0, status=0):
    return Fields(
        header=header(1),
        status=Fields(status=status),
        latitude=latitude,
        longitude=longitude,
        altitude=altitude,
    )


ROW = [1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.9]
STAMPED = Fields(header=header(1), pose=pose(1.0))
MESSAGES = {
    'PoseStamped': STAMPED,
    'Odometry': Fields(header=header(1), pose=Fields(pose=pose(1.0))),
    'Path': Fields(header=header(7), poses=[STAMPED]),
    'TransformStamped': transform(1.0),
    'TFMessage': Fields(transforms=[transform(1.0)]),
}


@pytest.mark.parametrize('kind', MESSAGES)
def test_the_pose_of_a_message(kind):
    assert PoseConverter().convert(MESSAGES[kind]) == [(S + 5, ROW)]


def test_the_transform_between_two_frames():
    message = Fields(
        transforms=[transform(4.0, 'map', 'odom'), transform(1.0, '/odom', 'base_link')]
    )
    converter = PoseConverter(('odom', 'base_link'))
    assert [found.row for found in converter.convert(message)] == [ROW]
    converter.check_frames('topic /tf', '--odom-frames')


@pytest.mark.parametrize('frames', [None, ('map', 'lidar')])
def test_frames_are_listed_as_flags(frames):
    converter = PoseConverter(frames)
    converter.convert(Fields(transforms=[transform(1.0), transform(1.0, child='camera')]))
    with pytest.raises(
        PlaceRecognitionError,
        match=r'topic /tf has .* 2 pairs .* use --f map:base_link \| --f map:camera$',
    ):
        converter.check_frames('topic /tf', '--f')


def test_satellite_positions_are_east_north_up():
    converter = PoseConverter()
    first, north, east, up = (
        np.array(converter.convert(message)[0].row)
        for message in (fix(50, 14), fix(50.001, 14), fix(50, 14.001), fix(50, 14, 210))
    )
    np.testing.assert_array_equal(first, np.zeros(7))
    # Lengths of a degree at 50 degrees north on WGS 84: 111229 m and 71696 m.
    np.testing.assert_allclose(north[:3], [0, 111.229, 0], atol=0.05)
    np.testing.assert_allclose(east[:3], [71.696, 0, 0], atol=0.05)
    np.testing.assert_allclose(up[:3], [0, 0, 10], atol=1e-6)


def test_a_message_without_a_fix_gives_no_pose():
    converter = PoseConverter()
    assert converter.convert(fix(0, 0, status=-1)) == []
    assert converter.convert(fix(np.nan, 0)) == []
    assert converter.convert(fix(50, 14, np.nan))[0].row[:3] == [0, 0, 0]
