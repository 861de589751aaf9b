# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Roll, zoom, and seasons of drawn scenes: the whole recognizer with the gradient grid."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import assemble
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
from hdc_place_recognition.results import Detection, Frame, Status
import numpy as np
from numpy.typing import NDArray
import pytest

S = 1_000_000_000
WIDTH, HEIGHT = 320, 240
BASE = Params(
    extractor='gradient_grid',
    dimensions=512,
    displacements_x=1,
    displacements_y=1,
    exclude_recent_s=5.0,
    threads=1,
)


class NoKeypoints:
    """An extractor that finds nothing, as in fog or at night."""

    identity = 'none'

    def extract(self, image: NDArray[np.uint8]) -> LocalFeatures:
        return LocalFeatures(
            keypoints=np.empty((0, 2), np.float32),
            descriptors=np.empty((0, 128), np.float32),
            width=image.shape[1],
            height=image.shape[0],
            sizes=np.empty(0, np.float32),
            angles=np.empty(0, np.float32),
        )


def new_recognizer(keypoints: bool = True, **changes: object) -> PlaceRecognizer:
    found = create_extractor('rootsift', image_width=WIDTH, max_features=300)
    grid = create_extractor('gradient_grid', image_width=WIDTH, max_features=1000)
    return assemble(BASE.replace(**changes), grid, found if keypoints else NoKeypoints())


def scene(seed: int) -> NDArray[np.uint8]:
    """Return a texture with structure of several sizes, larger than an image."""
    rng = np.random.default_rng(seed)
    values = np.zeros((2 * HEIGHT, 2 * WIDTH), np.float32)
    for size in (2, 4, 8, 16, 32):
        noise = rng.standard_normal((2 * HEIGHT // size, 2 * WIDTH // size)).astype(np.float32)
        values += size**0.7 * cv2.resize(noise, (2 * WIDTH, 2 * HEIGHT))
    return cv2.normalize(values, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


def view(place: NDArray[np.uint8], degrees: float = 0.0, zoom: float = 1.0) -> NDArray[np.uint8]:
    """Return the middle of a scene as a rolled and zoomed camera sees it."""
    turn = cv2.getRotationMatrix2D((WIDTH, HEIGHT), degrees, zoom)
    turn[:, 2] -= WIDTH / 2, HEIGHT / 2
    return np.asarray(cv2.warpAffine(place, turn, (WIDTH, HEIGHT)), np.uint8)


def show(
    recognizer: PlaceRecognizer, images: Iterable[NDArray[np.uint8]], start: int = 0
) -> list[Detection]:
    """Show images, one a second."""
    return [
        recognizer.process(Frame((start + index) * S, image)) for index, image in enumerate(images)
    ]


@pytest.fixture(scope='module')
def scenes() -> list[NDArray[np.uint8]]:
    return [scene(seed) for seed in range(16)]


@pytest.fixture(scope='module')
def driven(scenes: list[NDArray[np.uint8]]) -> PlaceRecognizer:
    recognizer = new_recognizer()
    show(recognizer, [view(place) for place in scenes])
    return recognizer


@pytest.mark.parametrize(
    ('degrees', 'zoom'),
    [(0, 1.0), (35, 1.0), (-35, 1.4), (35, 1.4), (45, 1.0), (180, 1.0), (0, 0.7)],
)
def test_a_rolled_and_zoomed_place_is_recognized(driven, scenes, degrees, zoom):
    driven.start_traverse()
    found = driven.recognize(driven.observe(Frame(0, view(scenes[3], degrees, zoom))))
    assert [candidate.match_id for candidate in found.accepted] == [3]


@pytest.mark.parametrize('seed', range(100, 105))
def test_a_different_scene_is_not(driven, seed):
    driven.start_traverse()
    found = driven.recognize(driven.observe(Frame(0, view(scene(seed), 35, 1.4))))
    assert not found.accepted and found.status is Status.BELOW_THRESHOLD


def other_season(place: NDArray[np.uint8], seed: int) -> NDArray[np.uint8]:
    """Return a view with other brightness and with noise."""
    noise = np.random.default_rng(seed).normal(0, 12, (HEIGHT, WIDTH))
    return (0.7 * view(place) + 40 + noise).clip(0, 255).astype(np.uint8)


def second_session(
    scenes: list[NDArray[np.uint8]],
    places: Iterable[int],
    *,
    restart: bool = True,
    **changes: object,
) -> list[list[int]]:
    """Return what is accepted without keypoints, after all scenes were seen once."""
    recognizer = new_recognizer(keypoints=False, **changes)
    show(recognizer, [view(place) for place in scenes])
    if restart:
        recognizer.start_traverse()
    found = show(
        recognizer,
        [other_season(scenes[place], 50 + index) for index, place in enumerate(places)],
        100,
    )
    return [[candidate.match_id for candidate in detection.accepted] for detection in found]


def test_a_path_without_keypoints_is_a_closure_with_another_session(scenes):
    found = second_session(scenes, range(2, 14))
    assert found[-1][0] == 13 and found[0] == []
    assert all(
        not ids or abs(ids[0] - place) <= 1 for ids, place in zip(found, range(2, 14), strict=True)
    )


@pytest.mark.parametrize(
    ('places', 'changes'),
    [
        (range(2, 14), {'restart': False}),
        (range(2, 14), {'allow_appearance_closures': False}),
        (range(13, 1, -1), {}),
        ([5] * 12, {}),
        ([2, 11, 5, 14, 8, 1, 12, 4, 9, 15, 0, 7], {}),
    ],
)
def test_what_is_no_path(scenes, places, changes):
    assert not any(second_session(scenes, places, **changes))


def test_long_ago_is_another_visit(scenes):
    found = second_session(scenes, range(2, 14), restart=False, appearance_gap_s=10.0)
    assert found[-1] and found[-1][0] == 13
