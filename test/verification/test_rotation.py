# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What a calibrated camera adds: how far it has turned."""

import csv
from types import SimpleNamespace

import cv2
from hdc_place_recognition.camera import Camera
from hdc_place_recognition.conversions.camera_info import camera_from_message
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.compact import quantize
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.verification.geometry import verify_geometry
from hdc_place_recognition.verification.rotation import relative_rotation
import numpy as np
from numpy.typing import NDArray
import pytest

WIDTH, HEIGHT, FOCAL = 640, 480, 500.0
BARREL = [0.26, -0.95, -0.005, 0.003, 1.16]


def info(**changes: object) -> SimpleNamespace:
    k = [FOCAL, 0, 319.5, 0, FOCAL, 239.5, 0, 0, 1]
    p = [400.0, 0, 319.5, 0, 0, 400.0, 239.5, 0, 0, 0, 1, 0]
    fields = {'width': WIDTH, 'height': HEIGHT, 'distortion_model': 'plumb_bob', 'd': [0.0] * 5}
    return SimpleNamespace(**{**fields, 'k': k, 'p': p, **changes})


def camera(**changes: object) -> Camera:
    return camera_from_message(info(**changes), rectified=False)


def turned(degrees: float) -> NDArray[np.float64]:
    """Return the matrix of a turn to the right, about the axis that points down."""
    return np.asarray(cv2.Rodrigues(np.radians([0.0, degrees, 0.0]))[0])


def seen(points: NDArray[np.float64], distortion: list[float], fisheye: bool) -> NDArray:
    """Return where a camera sees (n, 3) points, in widths of its image."""
    matrix = np.array([[FOCAL, 0, 319.5], [0, FOCAL, 239.5], [0, 0, 1]])
    project = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    pixels = project(points[:, None], np.zeros(3), np.zeros(3), matrix, np.array(distortion))[0]
    return (pixels.reshape(-1, 2) + 0.5) / WIDTH


def views(
    degrees: float,
    distortion: list[float] | None = None,
    fisheye: bool = False,
) -> NDArray[np.float32]:
    """Return points in front of a camera and of an earlier one, 1 m to the left of it."""
    scene = np.random.default_rng(0).uniform((-3, -2, 6), (3, 2, 12), (60, 3))
    query = (scene - (1, 0, 0)) @ turned(degrees)
    both = [seen(points, distortion or [0.0] * 4, fisheye) for points in (query, scene)]
    return np.stack(both, axis=1).astype(np.float32)


@pytest.mark.parametrize('degrees', [-12.0, 0.0, 5.0])
@pytest.mark.parametrize(
    ('model', 'distortion'), [('plumb_bob', BARREL), ('equidistant', [0.1, -0.02, 0.0, 0.0])]
)
def test_the_turn_between_two_views_is_found(degrees, model, distortion):
    pairs = views(degrees, distortion, model == 'equidistant')
    x, y, z, w = relative_rotation(camera(distortion_model=model, d=distortion), pairs)
    assert np.degrees(2 * np.arctan2(y, w)) == pytest.approx(degrees, abs=0.1)
    assert (x, z) == pytest.approx((0, 0), abs=1e-3)
    assert np.linalg.norm([x, y, z, w]) == pytest.approx(1, abs=1e-6)


def test_outliers_do_not_turn_it():
    pairs = views(5.0)
    pairs[:10, 0] = np.random.default_rng(1).random((10, 2))
    _, y, _, w = relative_rotation(camera(), pairs)
    assert np.degrees(2 * np.arctan2(y, w)) == pytest.approx(5, abs=0.1)


@pytest.mark.parametrize(
    'pairs',
    [
        np.empty((0, 2, 2), np.float32),
        np.zeros((7, 2, 2), np.float32),
        np.full((20, 2, 2), 0.5, np.float32),
        np.repeat(np.linspace(0, 1, 20, dtype=np.float32), 4).reshape(20, 2, 2),
    ],
)
def test_degenerate_points_raise_nothing(pairs):
    found = relative_rotation(camera(), pairs)
    assert found is None or np.linalg.norm(found) == pytest.approx(1, abs=1e-6)


def test_rectified_images_go_by_the_projection_matrix():
    found = camera_from_message(info(d=BARREL), rectified=True)
    assert found.matrix[0, 0] * WIDTH == pytest.approx(400) and not found.distortion.any()


def test_ros_1_writes_capitals():
    old = info()
    old = SimpleNamespace(
        width=WIDTH, height=HEIGHT, distortion_model='plumb_bob', D=old.d, K=old.k, P=old.p
    )
    assert np.array_equal(camera_from_message(old, rectified=False).matrix, camera().matrix)


def test_the_image_may_have_another_size_but_not_another_shape():
    assert camera().fits(240 / 320) and not camera().fits(240 / 640)


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'width': 0}, r'camera_info of 0 x 480'),
        ({'k': [0.0] * 9}, 'not calibrated'),
        ({'distortion_model': 'mei', 'd': [0.1] * 5}, "'mei' and 5 coefficients; supported are"),
        ({'d': [0.1] * 3}, "'plumb_bob' and 3 coefficients"),
    ],
)
def test_a_bad_calibration_is_named(changes, message):
    with pytest.raises(PlaceRecognitionError, match=message):
        camera(**changes)


def test_turns_of_a_hand_held_camera_are_those_of_motion_capture(shared_data):
    folder = shared_data / 'tum_fr1_desk'
    with (folder / 'poses.csv').open() as file:
        poses = np.array(list(csv.reader(file))[1:], np.float64)
    extractor = create_extractor('rootsift', image_width=320, max_features=300)
    files = sorted((folder / 'images').glob('*.jpg'))
    hand_held = camera(k=[517.3, 0, 318.6, 0, 516.5, 255.3, 0, 0, 1], d=BARREL)
    errors = []
    pairs = np.argwhere(np.load(folder / 'gt.npz')['hard'])
    for query, earlier in pairs[:: len(pairs) // 20].tolist():
        both = [quantize(extractor.extract(cv2.imread(str(files[i])))) for i in (query, earlier)]
        found = relative_rotation(hand_held, verify_geometry(*both).pairs)
        if found is not None:
            true = matrix(poses[earlier, 5:]).T @ matrix(poses[query, 5:])
            cosine = (np.trace(true.T @ matrix(found)) - 1) / 2
            errors.append(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    assert len(errors) > 10 and np.median(errors) < 5


def matrix(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
