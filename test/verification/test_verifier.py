# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which candidates are accepted, on drives through drawn worlds."""

from __future__ import annotations

from collections.abc import Iterable

from conftest import CellExtractor, texture
import cv2
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import assemble
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
from hdc_place_recognition.results import Detection, Frame, Reason, Status
import numpy as np
from numpy.typing import NDArray
import pytest

S = 1_000_000_000
WIDTH, HEIGHT, STEP = 320, 240, 60
BASE = Params(
    dimensions=512,
    displacements_x=1,
    displacements_y=1,
    min_interval_s=0.5,
    exclude_recent_s=8.0,
    min_score=0.9,
)


def new_recognizer(**changes: object) -> PlaceRecognizer:
    params = BASE.replace(**changes)
    keypoints = create_extractor('rootsift', image_width=320, max_features=300)
    return assemble(params, CellExtractor(), keypoints if params.verify else None)


def drive(images: Iterable[NDArray[np.uint8]], recognizer: PlaceRecognizer) -> list[Detection]:
    """Show images, one a second."""
    return [recognizer.process(Frame(index * S, image)) for index, image in enumerate(images)]


def noise(seed: int, height: int, width: int) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((height, width)).astype(np.float32)
    return sum(size * cv2.GaussianBlur(values, (0, 0), size) for size in (2, 5, 20))


def drawn(values: NDArray[np.float32]) -> NDArray[np.uint8]:
    return cv2.normalize(values, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


def street(places: Iterable[int]) -> list[NDArray[np.uint8]]:
    """Return views of a long wall, a step from one place to the next."""
    wall = drawn(noise(0, HEIGHT, WIDTH + 40 * STEP))
    lefts = [place * STEP for place in places]
    return [np.roll(wall, -left, axis=1)[:, :WIDTH].copy() for left in lefts]


def closures(detections: list[Detection], path: list[int]) -> list[int]:
    """Return of each accepted closure how many places the match is off."""
    return [
        path[index] - path[candidate.match_id]
        for index, found in enumerate(detections)
        for candidate in found.accepted
    ]


@pytest.fixture(scope='module')
def there_and_back() -> tuple[list[int], list[Detection]]:
    path = [*range(24), *range(23, 0, -1)]
    return path, drive(street(path), new_recognizer())


def test_the_way_back_is_recognized(there_and_back):
    path, detections = there_and_back
    off = closures(detections, path)
    # Whatever SIFT a version of OpenCV has: two fifths of the views are the same.
    assert off and all(abs(shift) * STEP <= 0.6 * WIDTH for shift in off)
    returning = detections[34:]
    assert sum(bool(found.accepted) for found in returning) >= 0.9 * len(returning)
    assert not any(found.accepted for found in detections[:24])


def test_another_place_is_held_against_the_best(there_and_back):
    found = there_and_back[1][-3]
    best, *others = found.candidates
    assert best.reason is Reason.ACCEPTED and best.accepted and best.inliers > 50
    for candidate in others:
        assert candidate.accepted == (candidate.score >= BASE.min_score)
        assert candidate.accepted == (candidate.reason is Reason.ACCEPTED)
        if not candidate.accepted:
            # At most half near the best, and what it leaves elsewhere.
            near = abs(candidate.match_id - best.match_id) <= 5
            assert candidate.score <= (0.5 if near else 1 - best.score + 1e-9)


def test_shift_is_where_the_scene_lies_in_the_earlier_image(there_and_back):
    path, detections = there_and_back
    for query, found in enumerate(detections):
        for candidate in found.accepted:
            steps = path[query] - path[candidate.match_id]
            assert candidate.shift_x == pytest.approx(steps * STEP / WIDTH, abs=0.01)


def test_look_alikes_are_no_closures():
    # The same door at every place of a corridor whose walls differ, but faintly.
    door = noise(99, 100, 80)
    images = []
    for place in range(24):
        wall = 0.15 * noise(place, HEIGHT, WIDTH)
        wall[80:180, 120:200] = door
        images.append(drawn(wall))
    detections = drive(images, new_recognizer())
    assert not any(found.accepted for found in detections)
    reasons = {found.candidates[0].reason for found in detections if found.candidates}
    assert reasons <= {
        Reason.LIKE_MANY,
        Reason.NO_SPREAD,
        Reason.FEW_INLIERS,
        Reason.NO_SUPPORT,
        Reason.AT_EDGE,
        Reason.UNLIKELY,
        Reason.SAME_VISIT,
    }


def test_standing_still_adds_little_and_confirms_nothing():
    recognizer = new_recognizer(verify=False)
    rng = np.random.default_rng(0)
    still = (
        (texture(7).astype(int) + rng.integers(-1, 2, (48, 64))).clip(0, 255).astype(np.uint8)
        for _ in range(600)
    )
    detections = drive(still, recognizer)
    assert len(recognizer.database) == 1
    assert {found.status for found in detections} == {Status.DATABASE_TOO_YOUNG}
    # It drives away and comes back: that is a closure.
    path = [*range(20, 32), 7]
    later = [
        recognizer.process(Frame((600 + n) * S, texture(place))) for n, place in enumerate(path)
    ]
    assert later[-1].accepted and later[-1].accepted[0].match_id == 0


def test_what_was_seen_just_before_a_stop_is_no_closure():
    # The views of a wall overlap: those before the stop show what is seen all the time.
    recognizer = new_recognizer()
    detections = drive(street([*range(4), *[4] * 60]), recognizer)
    assert len(recognizer.database) == 5
    assert not any(found.accepted for found in detections)


def test_all_images_are_stored_if_wanted():
    recognizer = new_recognizer(verify=False, keyframe_similarity=1.0)
    drive([texture(7)] * 20, recognizer)
    assert len(recognizer.database) == 20


def test_same_input_same_output_on_any_number_of_threads():
    images = street([*range(14), *range(13, 8, -1)])
    before = cv2.getNumThreads()
    try:
        found = []
        for threads in (1, 2, 2):
            cv2.setNumThreads(threads)
            found.append(drive(images, new_recognizer(threads=threads)))
    finally:
        cv2.setNumThreads(before)
    assert found[0] == found[1] == found[2]


def test_images_without_keypoints_are_answered():
    flat = np.tile(np.linspace(0, 255, WIDTH).astype(np.uint8), (HEIGHT, 1))
    views = [flat, *street(range(12)), flat]
    found = drive(views, new_recognizer())[-1]
    assert found.status is Status.BELOW_THRESHOLD
    assert {candidate.inliers for candidate in found.candidates} <= {0, -1}


def test_memory_of_a_keyframe():
    recognizer = new_recognizer(dimensions=4096, displacements_x=5, displacements_y=5)
    drive(street(range(4)), recognizer)
    database = recognizer.database
    held = sum(
        recognizer.database.get(found).keypoints.nbytes for found in recognizer.database.ids
    )
    room = database.nbytes - held
    assert held <= 4 * (300 * 70 + 640)
    assert held / 4 + room / 64 <= 60_000
