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


@pytest.mark.parametrize(('cosine', 'moved'), [(0.5, True), (0.5625, False), (-1.0, True)])
def test_an_image_is_alike_above_the_similarity(cosine, moved):
    selector, params = KeyframeSelector(), Params(keyframe_similarity=0.5)
    assert selector.moved(vector(1, 0), None, params)
    assert selector.moved(vector(cosine, 0), None, params) is moved


def test_every_image_is_new_at_a_similarity_of_one():
    selector, params = KeyframeSelector(), Params(keyframe_similarity=1.0)
    # Rounding may put the product of a unit vector with itself above 1.
    assert all(selector.moved(vector(1.001, 0), None, params) for _ in range(2))


def test_an_image_without_features_does_not_replace_the_last_keyframe():
    selector = KeyframeSelector()
    assert selector.moved(vector(1, 0), pose(0), PARAMS)
    assert selector.moved(vector(0, 0), pose(1), PARAMS)
    assert not selector.moved(vector(1, 0), pose(2), PARAMS)
    assert not selector.moved(vector(0, 1), pose(0.4), PARAMS)


@pytest.mark.parametrize(
    ('position', 'near'),
    [
        ((0, 0, 0), True),
        ((0.3, 0.3, 0.2), True),
        ((0.5, 0, 0), False),
        ((0, 0.5, 0), False),
        ((0, 0, -0.5), False),
    ],
)
def test_poses_are_near_below_the_distance(position, near):
    upright = (0.0, 0.0, 0.0, 1.0)
    assert Pose((0, 0, 0), upright).near(Pose(position, upright), 0.5, 10.0) is near


def test_a_turn_counts_about_any_axis_and_zero_is_never_near():
    half = math.radians(8) / 2
    for axis in range(3):
        turned = [0.0, 0.0, 0.0, math.cos(half)]
        turned[axis] = math.sin(half)
        first, second = pose(0), Pose((0.0, 0.0, 0.0), tuple(turned))
        assert first.near(second, 0.5, 8.01) and not first.near(second, 0.5, 7.99)
    assert not pose(0).near(pose(0), 0.0, 10.0) and not pose(0).near(pose(0), 0.5, 0.0)
