# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which images become keyframes, by what they show and by odometry."""

import math

from conftest import CellExtractor, texture
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import assemble
from hdc_place_recognition.recognition.keyframes import KeyframeSelector, Pose
from hdc_place_recognition.results import Frame
import numpy as np
import pytest

S = 1_000_000_000
PARAMS = Params(keyframe_distance_m=0.5, keyframe_angle_deg=10.0)


def vector(*values: float) -> np.ndarray:
    return np.array(values, np.float32)


def pose(x: float, degrees: float = 0.0, sign: float = 1.0) -> Pose:
    half = math.radians(degrees) / 2
    return Pose((x, 0.0, 0.0), (0.0, 0.0, sign * math.sin(half), sign * math.cos(half)))


@pytest.mark.parametrize(
    ('second', 'moved'),
    [
        (pose(0.4), False),
        (pose(0.6), True),
        (pose(0.4, 9), False),
        (pose(0.0, -11), True),
        (pose(0.4, 9, sign=-1.0), False),
        (None, True),
    ],
)
def test_odometry_tells_whether_the_robot_has_moved(second, moved):
    selector = KeyframeSelector()
    assert selector.moved(vector(1, 0), pose(0), PARAMS)
    assert selector.moved(vector(0, 1), second, PARAMS) is moved


def test_steps_are_measured_from_the_last_keyframe():
    selector = KeyframeSelector()
    looks = [vector(math.cos(angle), math.sin(angle)) for angle in range(6)]
    steps = [selector.moved(look, pose(0.2 * n), PARAMS) for n, look in enumerate(looks)]
    assert steps == [True, False, False, True, False, False]


def test_what_looks_the_same_is_the_same_wherever_odometry_says():
    selector = KeyframeSelector()
    assert selector.moved(vector(1, 0), pose(0), PARAMS)
    assert not selector.moved(vector(1, 0), pose(9), PARAMS)


def test_by_default_odometry_does_not_matter():
    selector = KeyframeSelector()
    assert selector.moved(vector(1, 0), pose(0), Params())
    assert selector.moved(vector(0, 1), pose(0), Params())


def test_people_who_walk_past_a_robot_at_rest_fill_no_database():
    recognizer = assemble(PARAMS, CellExtractor())
    recognizer.traverse().odometry = lambda stamp_ns: pose(0 if stamp_ns else 1)
    stored = [recognizer.process(Frame(n * S, texture(n))).keyframe_id for n in range(30)]
    assert stored == [0, 1, *[None] * 28]
