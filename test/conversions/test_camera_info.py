# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Cameras from CameraInfo messages as drivers send them: the rays of pixels are exact."""

from types import SimpleNamespace as Fields

import cv2
from hdc_place_recognition.conversions.camera_info import camera_from_message
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
import pytest

WIDTH, HEIGHT = 640, 480
BARREL = [-0.28, 0.07, 0.001, -0.001, 0.0]
EQUIDISTANT = [-0.01, 0.02, -0.01, 0.002]
RATIONAL = [0.5, 0.1, 0.001, -0.001, 0.01, 0.8, 0.2, 0.02]


def info(focal=300.0, roi=(0, 0, 0, 0), binning=(0, 0), size=(WIDTH, HEIGHT), **changes):
    fields = {
        'width': size[0],
        'height': size[1],
        'distortion_model': 'plumb_bob',
        'd': [],
        'k': [focal, 0.0, size[0] / 2, 0.0, focal, size[1] / 2, 0.0, 0.0, 1.0],
        'p': [0.0] * 12,
        'binning_x': binning[0],
        'binning_y': binning[1],
        'roi': Fields(x_offset=roi[0], y_offset=roi[1], width=roi[2], height=roi[3]),
    }
    return Fields(**{**fields, **changes})


def directions(limit):
    """Return rays at most so far from the axis, (n, 2)."""
    x, y = np.meshgrid(np.linspace(-limit, limit, 15), np.linspace(-limit, limit, 11) * 0.75)
    return np.column_stack([x.ravel(), y.ravel()])


def worst_error(message, rays, coefficients, fisheye=False, window=(0, 0, WIDTH), binning=(1, 1)):
    """Project rays to pixels of the sensor; return the error of their rays in pixels."""
    points = np.column_stack([rays, np.ones(len(rays))])[:, None]
    project = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    matrix = np.array(message.k).reshape(3, 3)
    pixels, _ = project(points, np.zeros(3), np.zeros(3), matrix, np.array(coefficients))
    # Pixel centers of the sensor are at integers, the corner of the image is its origin.
    shown = (pixels[:, 0] + 0.5 - window[:2]) / binning / (window[2] / binning[0])
    camera = camera_from_message(message, rectified=False)
    return np.abs(camera.directions(shown.astype(np.float32)) - rays).max() * matrix[0, 0]


@pytest.mark.parametrize(
    ('focal', 'coefficients'),
    [(300, [-0.40, 0.20, 0, 0, -0.05]), (380, [-0.40, 0.20, 0, 0, -0.05]), (300, BARREL)],
)
def test_wide_angles_are_exact(focal, coefficients):
    message = info(focal, d=coefficients)
    assert worst_error(message, directions(1.07), coefficients) < 0.01


MODELS = [
    ('equidistant', [*EQUIDISTANT, 0.0], EQUIDISTANT, True),
    ('fisheye', EQUIDISTANT, EQUIDISTANT, True),
    ('Kannala Brandt4', EQUIDISTANT, EQUIDISTANT, True),
    ('equidistant', [], [0.0] * 4, True),
    ('plumb_bob', BARREL[:4], BARREL[:4], False),
    ('plumb_bob', [*BARREL, 0.0, 0.0, 0.0], BARREL, False),
    ('plumb_bob', BARREL + [0.0] * 9, BARREL, False),
    ('plumb_bob', RATIONAL, RATIONAL, False),
    ('rational_polynomial', BARREL, BARREL, False),
    ('rational_polynomial', RATIONAL, RATIONAL, False),
    ('RATIONAL-POLYNOMIAL', [*RATIONAL, 0.01, 0.0, 0.0, 0.02], None, False),
    ('radtan', BARREL, BARREL, False),
]


@pytest.mark.parametrize(('model', 'sent', 'coefficients', 'fisheye'), MODELS)
def test_models_that_drivers_name(model, sent, coefficients, fisheye):
    message = info(distortion_model=model, d=sent)
    error = worst_error(message, directions(0.9), coefficients or sent, fisheye)
    assert error < 0.01


def test_a_window_of_the_sensor():
    message = info(600.0, (320, 240, 640, 480), size=(1280, 960), d=BARREL)
    assert worst_error(message, directions(0.5), BARREL, window=(320, 240, 640)) < 0.01
    assert camera_from_message(message, rectified=False).fits(480 / 640)


@pytest.mark.parametrize('binning', [(2, 2), (2, 1), (1, 2)])
def test_binning(binning):
    message = info(d=BARREL, binning=binning)
    error = worst_error(
        message, directions(0.9), BARREL, window=(0, 0, WIDTH), binning=np.array(binning)
    )
    assert error < 0.01
    image_aspect = HEIGHT / binning[1] / (WIDTH / binning[0])
    assert camera_from_message(message, rectified=False).fits(image_aspect)


def test_a_rectified_window():
    p = [300.0, 0.0, 320.0, 0.0, 0.0, 300.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    message = info(roi=(64, 48, 320, 240), p=p)
    camera = camera_from_message(message, rectified=True)
    center = np.array([[320.5 - 64, 240.5 - 48]], np.float32) / 320
    np.testing.assert_allclose(camera.directions(center), [[0, 0]], atol=1e-6)


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'roi': (320, 0, 321, 480)}, 'roi 321 x 480 at 320, 0 of 640 x 480'),
        ({'roi': (0, 0, 0, 480)}, 'roi 0 x 480'),
        ({'k': [0.0] * 9}, 'not calibrated'),
        ({'k': []}, '0 numbers in the matrix k: the camera is not calibrated'),
        ({'d': [np.nan] * 5}, 'not all finite; supported are plumb_bob'),
        ({'d': [0.1] * 15}, "'plumb_bob' and 15 coefficients"),
        ({'distortion_model': 'fisheye', 'd': [0.1] * 5}, "'fisheye' and 5 coefficients"),
        ({'distortion_model': '', 'd': [0.1] * 5}, "'' and 5 coefficients"),
    ],
)
def test_a_message_that_cannot_be_used(changes, reason):
    with pytest.raises(PlaceRecognitionError, match=reason):
        camera_from_message(info(**changes), rectified=False)


def test_points_that_no_ray_reaches_are_finite():
    camera = camera_from_message(info(d=[-0.40, 0.0, 0.0, 0.0]), rectified=False)
    far = np.array([[-3, -3], [5, 0.3], [0.5, 0.4]], np.float32)
    assert np.isfinite(camera.directions(far)).all()
