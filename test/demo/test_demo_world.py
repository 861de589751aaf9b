# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The rendered drive is repeatable, returns to its places, and these can be recognized."""

from __future__ import annotations

import cv2
from hdc_place_recognition.conversions.image import image_from_message, stamp_ns
from hdc_place_recognition.demo.bag import (
    CAMERA_INFO_TOPIC,
    IMAGE_TOPIC,
    LAPS,
    ODOMETRY_TOPIC,
    write_bag,
)
from hdc_place_recognition.demo.camera import Camera
from hdc_place_recognition.demo.canvas import Canvas
from hdc_place_recognition.demo.light import Light
from hdc_place_recognition.demo.panels import Panel, Sprite, Texture, upright
from hdc_place_recognition.demo.raster import draw
from hdc_place_recognition.demo.route import IMAGE_PERIOD_NS, Moment, Pose, Route
from hdc_place_recognition.demo.shadows import Walls
from hdc_place_recognition.demo.world import StreetWorld
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores


@pytest.fixture(scope='module')
def world() -> StreetWorld:
    return StreetWorld(seed=0)


def place(moment: Moment) -> NDArray[np.float64]:
    return np.array([moment.pose.x, moment.pose.y])


def outlines(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return coarse edges at unit length, which do not depend on light and color."""
    gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
    edges = np.hypot(cv2.Sobel(gray, cv2.CV_32F, 1, 0), cv2.Sobel(gray, cv2.CV_32F, 0, 1))
    coarse = cv2.resize(cv2.GaussianBlur(np.sqrt(edges), (0, 0), 6), (32, 24)).ravel()
    centered = coarse.astype(np.float64) - coarse.mean()
    return centered / np.linalg.norm(centered)


def test_same_seed_same_pixels(world):
    pose = next(Route(1.0).images()).pose
    image = world.render(pose, 0)
    assert image.shape == (240, 320, 3) and image.dtype == np.uint8
    assert np.array_equal(image, StreetWorld(seed=0).render(pose, 0))
    assert not np.array_equal(image, StreetWorld(seed=1).render(pose, 0))


def test_route_closes_and_comes_back_in_another_lane():
    moments = list(Route(LAPS).images())
    first, second = ([moment for moment in moments if moment.lap == lap] for lap in (0, 1))
    assert 100 < len(first) < 160 and 200 < len(moments) < 300
    distances = [min(np.linalg.norm(place(a) - place(b)) for a in first) for b in second[10:]]
    assert 1.0 < np.median(distances) < 2.0 and max(distances) < 2.5
    steps = np.diff([moment.stamp_ns for moment in moments])
    assert set(steps) == {IMAGE_PERIOD_NS}


def test_second_lap_is_changed_but_like_the_same_place(world):
    moments = list(Route(LAPS).images())
    first = [moment for moment in moments if moment.lap == 0][::12]
    for later in [moment for moment in moments if moment.lap == 1][15::35]:
        seen = outlines(world.render(later.pose, 1))
        near = min(moments[:130], key=lambda moment: np.linalg.norm(place(moment) - place(later)))
        before = world.render(near.pose, 0)
        assert np.abs(world.render(near.pose, 1).astype(int) - before).mean() > 10
        elsewhere = [
            seen @ outlines(world.render(moment.pose, 0))
            for moment in first
            if np.linalg.norm(place(moment) - place(later)) > 15
        ]
        assert seen @ outlines(before) > np.mean(elsewhere) + 2 * np.std(elsewhere)


# Looks east from 1.5 m above the origin: 20 pixels are 1 m at a distance of 10 m.
CAMERA = Camera(width=400, height=300, field_of_view_deg=90.0, height_m=1.5)
ORIGIN = Pose(0.0, 0.0, 0.0)


def wall(distance: float, color: int, left: float = 1.0, right: float = -1.0) -> Panel:
    """Return a wall across the view, from 0.5 m to 2.5 m."""
    texture = Texture(np.full((4, 4, 3), color, np.uint8))
    return upright((distance, left), (distance, right), 0.5, 2.5, texture)


def drawn(*panels: Panel) -> NDArray[np.uint8]:
    return draw(np.zeros((300, 400, 3), np.uint8), panels, CAMERA, ORIGIN)[:, :, 0]


def test_panel_is_seen_in_perspective():
    # Its edges lie 20 pixels from the middle of the image, which is between two pixels.
    rows, columns = np.nonzero(drawn(wall(10, 200)))
    assert (rows.min(), rows.max()) == pytest.approx((129.5, 169.5), abs=1)
    assert (columns.min(), columns.max()) == pytest.approx((179.5, 219.5), abs=1)


@pytest.mark.parametrize('order', [1, -1])
def test_nearer_panel_hides_the_farther_one(order):
    image = drawn(*[wall(10, 200, left=2.0), wall(5, 100, left=0.5, right=-0.5)][::order])
    assert image[150, 200] == 100 and image[150, 165] == 200


def test_back_of_a_panel_and_what_is_behind_the_camera_are_not_seen():
    assert not drawn(wall(10, 200, left=-1.0, right=1.0), wall(-10, 200)).any()


def test_wall_along_the_street_begins_beside_the_camera():
    texture = Texture(np.full((4, 4, 3), 200, np.uint8))
    image = drawn(upright((-5, 3), (50, 3), 0.0, 4.0, texture))
    # At the left border it is 3 m away and stands 100 pixels below the middle of the image.
    assert image[:249, 0].all() and not image[252:].any()
    # Its far end is 3 m / 50 m * 200 pixels to the left of the middle.
    assert image[150, :186].all() and not image[:, 189:].any()


def test_clear_parts_of_a_picture_show_what_is_behind():
    pixels = np.full((4, 4, 4), 100, np.uint8)
    pixels[:, :, 3] = [[0], [0], [255], [255]]
    picture = Sprite((5.0, 0.0), 1.0, 3.0, Texture(pixels)).facing(ORIGIN.yaw)
    image = drawn(picture, wall(10, 200))
    assert image[140, 200] == 200 and image[160, 200] == 100


def test_shadow_of_the_house_opposite():
    light = Light(0, 45, (1, 1, 1), (1, 1, 1), (0, 0, 0), (0, 0, 0), 0)
    walls = Walls(np.array([[10.0, -5.0]]), np.array([[10.0, 5.0]]), np.array([12.0]))
    # The sun stands in the east, as high as it is far: 12 m of wall, 10 m away.
    assert walls.shadow_height(np.array([0.0, 0.0]), light) == pytest.approx(2.0)
    assert walls.shadow_height(np.array([0.0, 6.0]), light) == 0
    assert walls.shadow_height(np.array([-3.0, 0.0]), light) == 0
    assert walls.shadow_height(np.array([11.0, 0.0]), light) == 0
    assert walls.shadows(light)[0, 2] == pytest.approx([-2.0, 5.0])


@pytest.mark.parametrize('storage', ['sqlite3', 'mcap'])
def test_bag_holds_the_drive(tmp_path, storage):
    write_bag(tmp_path / 'bag', storage=storage, laps=0.03)
    route = Route(0.03)
    with AnyReader(
        [tmp_path / 'bag'], default_typestore=get_typestore(Stores.ROS2_JAZZY)
    ) as reader:
        messages = [
            (connection.topic, reader.deserialize(raw, connection.msgtype))
            for connection, _, raw in reader.messages()
        ]
    images = [message for topic, message in messages if topic == IMAGE_TOPIC]
    odometry = [message for topic, message in messages if topic == ODOMETRY_TOPIC]
    info = [message for topic, message in messages if topic == CAMERA_INFO_TOPIC]
    assert len(images) + len(odometry) + len(info) == len(messages)
    stamps = [stamp_ns(message) for _, message in messages]
    assert stamps == sorted(stamps) and stamps[0] > 10**18
    assert [stamp_ns(message) for message in info] == [stamp_ns(message) for message in images]
    # 320 pixels cover 80 degrees.
    assert info[0].k[0] == pytest.approx(160 / np.tan(np.radians(40)))
    assert [stamp_ns(message) for message in images] == [
        moment.stamp_ns for moment in route.images()
    ]
    assert [stamp_ns(message) for message in odometry] == [
        moment.stamp_ns for moment in route.odometry()
    ]
    first = next(route.images())
    assert np.array_equal(image_from_message(images[0]), StreetWorld(seed=0).render(first.pose, 0))
    start = next(route.odometry()).pose
    assert odometry[0].pose.pose.position.x == start.x
    assert odometry[0].pose.pose.orientation.w == pytest.approx(np.cos(start.yaw / 2))


def test_bag_that_cannot_be_written(tmp_path):
    with pytest.raises(PlaceRecognitionError, match="storage 'zip' is none of sqlite3, mcap"):
        write_bag(tmp_path / 'bag', storage='zip')
    with pytest.raises(PlaceRecognitionError, match=r'cannot write bag .*exists'):
        write_bag(tmp_path, laps=0.01)


def test_writing_on_a_canvas_leaves_no_holes():
    canvas = Canvas(4.0, 1.0, 32.0, (20, 20, 200))
    canvas.text('SHOP', 0.2, 0.2, 3.8, 0.8, (250, 250, 250))
    assert (canvas.pixels[:, :, 0] > 200).any()
    assert (canvas.pixels[:, :, 3] == 255).all()
