# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The recognizer as the node and the offline tools use it."""

from conftest import CellExtractor, texture
import cv2
from hdc_place_recognition.camera import Camera
from hdc_place_recognition.database.base import Added
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.hdc.words import KEYPOINTS
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import (
    assemble,
    create_recognizer,
    library_threads,
    use_threads,
)
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
from hdc_place_recognition.results import Detection, Frame, NOT_VERIFIED, Status
from hdc_place_recognition.verification.static_content import StaticContent
import numpy as np
import pytest
import threadpoolctl

S = 1_000_000_000
BASE = Params(dimensions=1024, min_interval_s=0.5, exclude_recent_s=5.0, min_score=0.8)


def new_recognizer(**changes: object) -> PlaceRecognizer:
    return assemble(BASE.replace(**changes), CellExtractor())


def drive(places: list[int], recognizer: PlaceRecognizer | None = None) -> list[Detection]:
    """Visit places, one a second."""
    recognizer = recognizer or new_recognizer()
    return [
        recognizer.process(Frame(index * S, texture(place))) for index, place in enumerate(places)
    ]


def test_finds_the_loop():
    detections = drive([*range(10), 3, 4])
    assert [found.candidates[0].match_id for found in detections[10:]] == [3, 4]
    last = detections[-1]
    assert last.status is Status.ACCEPTED and last.accepted[0].match_stamp_ns == 4 * S
    assert last.accepted[0].query_stamp_ns == 11 * S
    assert last.accepted[0].similarity == pytest.approx(1, abs=1e-5)
    assert last.keyframe_id == 11 and last.n_features == 16


def test_straight_run_finds_none():
    for index, found in enumerate(drive(list(range(20)))):
        assert not found.accepted
        expected = Status.DATABASE_TOO_YOUNG if index < 5 else Status.BELOW_THRESHOLD
        assert found.status is expected


def test_recent_images_are_no_candidates():
    # The robot stands still: everything looks the same, but all of it is younger than 5 s.
    detections = drive([7] * 5)
    assert all(found.status is Status.DATABASE_TOO_YOUNG for found in detections)


def test_exclusion_comes_before_the_best_are_taken():
    detections = drive([3, 1, 2, *[3] * 5], new_recognizer(top_k=1))
    assert detections[-1].candidates[0].match_id == 0


def test_exclusion_by_count():
    found = drive([3, 1, 2, 3], new_recognizer(exclude_recent_s=0.0, exclude_recent_frames=2))[-1]
    assert [candidate.match_id for candidate in found.candidates] == [0]
    assert len(found.similarities) == 1


def test_whole_row_of_similarities_and_top_k():
    found = drive(list(range(32)), new_recognizer(top_k=3))[-1]
    assert found.similarities.shape == (27,)
    rows = [candidate.match_id for candidate in found.candidates]
    # The best, and the best of those that are not next to it.
    assert rows[0] == found.similarities.argmax() and len(rows) == 3
    assert np.diff(sorted(rows)).min() > 3
    similarities = [candidate.similarity for candidate in found.candidates]
    assert similarities == sorted(similarities, reverse=True)
    assert similarities == found.similarities[rows].tolist()


def test_live_parameter_takes_effect_with_the_next_image():
    recognizer = new_recognizer()
    drive([*range(10), 3], recognizer)
    recognizer.params = recognizer.params.replace(min_score=0.0)
    found = recognizer.process(Frame(20 * S, texture(99)))
    assert found.status is Status.ACCEPTED and found.accepted == found.candidates


def test_images_too_near_are_skipped():
    recognizer = new_recognizer()
    first, second = (
        recognizer.process(Frame(0, texture(0))),
        recognizer.process(Frame(S // 4, texture(0))),
    )
    assert first.status is Status.DATABASE_TOO_YOUNG
    assert second.status is Status.TOO_SOON and second.keyframe_id is None
    assert len(recognizer.database) == 1


def test_blank_image_is_answered_and_not_stored():
    recognizer = new_recognizer()
    drive(list(range(8)), recognizer)
    found = recognizer.process(Frame(9 * S, np.zeros((48, 64), np.uint8)))
    assert found.status is Status.NO_FEATURES and found.candidates == ()
    assert found.keyframe_id is None and len(recognizer.database) == 8
    assert np.isfinite(found.similarities).all()


@pytest.mark.parametrize(
    'image', [texture(1), texture(1).astype(np.uint16) * 257, np.dstack([texture(1)] * 3)]
)
def test_gray_16_bit_and_color_are_the_same_place(image):
    recognizer = new_recognizer()
    drive(list(range(8)), recognizer)
    assert recognizer.process(Frame(9 * S, image)).candidates[0].match_id == 1


def test_no_image_is_an_error_and_changes_nothing():
    recognizer = new_recognizer()
    with pytest.raises(PlaceRecognitionError, match='image'):
        recognizer.process(Frame(5 * S, np.zeros((3, 4, 5, 6), np.uint8)))
    assert recognizer.process(Frame(5 * S, texture(0))).keyframe_id == 0


def test_clock_set_back_keeps_the_places():
    recognizer = new_recognizer()
    drive(list(range(10)), recognizer)
    found = recognizer.process(Frame(0, texture(2)))
    assert found.status is Status.ACCEPTED and found.candidates[0].match_id == 2


def test_sequences_tell_look_alikes_apart():
    # Places 0-4, then 10, 11, 2: alone the last image fits; with what came before it does not.
    places = [0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 2]
    alone, together = drive(places)[-1], drive(places, new_recognizer(sequence_length=3))[-1]
    assert alone.status is Status.ACCEPTED
    assert together.status is Status.BELOW_THRESHOLD
    again = drive([0, 1, 2, 3, 4, 5, 6, 7, 8, 0, 1, 2], new_recognizer(sequence_length=3))[-1]
    assert again.status is Status.ACCEPTED and again.candidates[0].match_id == 2


def test_two_traverses_and_retrieval():
    recognizer = new_recognizer()
    observed = [recognizer.observe(Frame(index * S, texture(index))) for index in range(6)]
    assert [recognizer.store(image).keyframe_id for image in observed] == list(range(6))
    recognizer.start_traverse()
    asked = recognizer.recognize(recognizer.observe(Frame(0, texture(4))))
    assert asked.candidates[0].match_id == 4 and asked.keyframe_id is None
    assert len(recognizer.database) == 6 and asked.similarities.shape == (6,)
    skipped = recognizer.recognize(observed[4], without=4)
    assert 4 not in [candidate.match_id for candidate in skipped.candidates]
    assert skipped.candidates and skipped.candidates[0].score < 0.8


def test_same_input_same_output():
    first, again = drive([*range(10), 3]), drive([*range(10), 3])
    assert first == again
    assert np.array_equal(first[-1].similarities, again[-1].similarities)


def test_recognizer_names_its_features():
    assert new_recognizer().identity == 'cells'


def test_every_stage_is_timed():
    found = drive(list(range(7)))[-1]
    assert set(found.milliseconds) == {'extract', 'encode', 'query', 'insert'}
    assert all(spent >= 0 for spent in found.milliseconds.values())


@pytest.mark.parametrize('length', [1, 3])
def test_warm_up_leaves_no_trace(length):
    params = BASE.replace(extractor='gradient_grid', sequence_length=length, min_score=0.0)
    cold, warm = create_recognizer(params), create_recognizer(params)
    warm.warm_up(160, 120)
    assert len(warm.database) == 0
    places = [*range(8), 3, 4]
    for index, place in enumerate(places):
        image = cv2.resize(texture(place), (160, 120), interpolation=cv2.INTER_CUBIC)
        found, expected = (
            recognizer.process(Frame(index * S, image)) for recognizer in (warm, cold)
        )
        assert found == expected
        assert np.array_equal(found.similarities, expected.similarities)
    assert found.candidates[0].inliers != NOT_VERIFIED


def test_warm_up_has_seen_to_everything():
    recognizer = new_recognizer()
    recognizer.warm_up(64, 48)
    assert recognizer._encoder._descriptor.projection.cache_info().currsize == 1


def test_two_traverses_run_side_by_side():
    """Each camera goes its own way; together they answer as each alone, but for the database."""
    both, alone = new_recognizer(exclude_recent_s=0.0), new_recognizer(exclude_recent_s=0.0)
    left, right = list(range(12)), list(range(20, 32))
    for index, (place, place_on_the_right) in enumerate(zip(left, right, strict=True)):
        frame = Frame(index * S, texture(place), 'left')
        found, expected = both.process(frame), alone.process(Frame(index * S, texture(place)))
        assert found.status is expected.status
        assert found.keyframe_id == 2 * expected.keyframe_id
        assert (
            both.process(Frame(index * S, texture(place_on_the_right), 'right')).keyframe_id
            is not None
        )
    assert both.traverse('left').filter.clock_ns == alone.traverse().filter.clock_ns
    assert both.database.near(4, 1) == (2, 6) and both.database.distance(4, 5) is None


def test_a_stamp_of_a_camera_is_not_that_of_another():
    recognizer = new_recognizer()
    assert recognizer.process(Frame(5 * S, texture(0), 'left')).status is Status.DATABASE_TOO_YOUNG
    assert recognizer.skip_reason(5 * S, 'left') is Status.STAMP_REPEATED
    assert recognizer.skip_reason(5 * S, 'right') is None
    assert recognizer.process(Frame(5 * S, texture(1), 'right')).keyframe_id == 1


def test_another_traverse_is_newer_than_those_before():
    recognizer = new_recognizer()
    drive([3, 1, 2], recognizer)
    traverse = recognizer.start_traverse()
    assert traverse.number == 1 and recognizer.traverse() is traverse
    # What was seen before is two seconds old, whatever the stamps say.
    assert recognizer.process(Frame(0, texture(3))).status is Status.DATABASE_TOO_YOUNG
    again = [recognizer.process(Frame(n * S, texture(50 + n))) for n in range(1, 5)]
    assert again[-1].status is Status.BELOW_THRESHOLD
    assert recognizer.process(Frame(5 * S, texture(3))).accepted[0].match_id == 0


def test_encoding_is_pure():
    recognizer = new_recognizer()
    before = recognizer.encode(texture(3))
    drive([1, 2, 3, 4], recognizer)
    assert np.array_equal(recognizer.encode(texture(3)), before)
    assert before.shape == (1024,) and np.linalg.norm(before) == pytest.approx(1, abs=1e-5)


def test_one_snapshot_of_the_parameters_serves_an_image():
    recognizer = new_recognizer()
    drive([*range(10), 3], recognizer)
    snapshot = recognizer.params.replace(min_score=0.0, min_interval_s=60.0)
    assert recognizer.process(Frame(11 * S, texture(98)), snapshot).status is Status.TOO_SOON
    found = recognizer.process(Frame(90 * S, texture(99)), snapshot)
    assert found.status is Status.ACCEPTED and found.accepted == found.candidates
    assert recognizer.process(Frame(91 * S, texture(97))).status is Status.BELOW_THRESHOLD


class Switching:
    """An extractor during which the parameters are replaced, as by another thread."""

    identity = 'switching'

    def __init__(self) -> None:
        self.change = lambda: None

    def extract(self, image: np.ndarray) -> object:
        self.change()
        return CellExtractor().extract(image)


def test_a_live_change_never_applies_to_half_an_image():
    extractor = Switching()
    recognizer = assemble(BASE, extractor)
    drive([*range(10), 3], recognizer)

    def change() -> None:
        recognizer.params = recognizer.params.replace(min_score=0.0, top_k=1)

    extractor.change = change
    assert recognizer.process(Frame(20 * S, texture(99))).status is Status.BELOW_THRESHOLD
    found = recognizer.process(Frame(21 * S, texture(98)))
    assert found.status is Status.ACCEPTED and len(found.candidates) == 1


def blas_threads() -> list[int]:
    """Return the threads of each BLAS that is loaded; some can only have one."""
    libraries = threadpoolctl.threadpool_info()
    return [library['num_threads'] for library in libraries if library['user_api'] == 'blas']


def test_creating_a_recognizer_leaves_the_threads_of_the_process_alone():
    cv2.setNumThreads(2)
    with threadpoolctl.threadpool_limits(2, user_api='blas'):
        before = blas_threads()
        create_recognizer(BASE.replace(extractor='gradient_grid', threads=1)).encode(texture(0))
        assert blas_threads() == before and 2 in before and cv2.getNumThreads() == 2
        use_threads(BASE.replace(threads=1))
        assert set(blas_threads()) == {1} and cv2.getNumThreads() == 1


def test_features_without_a_calibration_are_named_once(caplog):
    caplog.set_level('WARNING', 'hdc_place_recognition')
    drive([0, 1, 2])
    (line,) = [record.getMessage() for record in caplog.records]
    assert line.startswith('the score is not calibrated for the features "cells"')


def test_another_traverse_of_a_camera_keeps_its_calibration_and_odometry():
    recognizer, camera = new_recognizer(), Camera(np.eye(3), np.zeros(5), False, 0.75)
    before = recognizer.traverse('left')
    before.camera, before.odometry = camera, lambda stamp_ns: None
    after = recognizer.start_traverse('left')
    assert after is not before and (before.number, after.number) == (0, 1)
    assert after.camera is camera and after.odometry is before.odometry
    right = recognizer.start_traverse('right')
    assert right.number == 2 and right.camera is None


@pytest.mark.parametrize('image', [texture(0), np.zeros((48, 64), np.uint8)])
def test_what_is_not_new_or_has_no_features_is_not_stored(image):
    recognizer = new_recognizer()
    assert recognizer.store(recognizer.observe(Frame(0, texture(0)))) == Added(0)
    assert recognizer.store(recognizer.observe(Frame(S, image))) == Added()
    assert len(recognizer.database) == 1


@pytest.mark.parametrize('verify', [False, True])
def test_a_recognizer_tells_whether_it_verifies(verify):
    recognizer = create_recognizer(BASE.replace(extractor='gradient_grid', verify=verify))
    assert recognizer.verifies is verify
    found = recognizer._encoder.encode(texture(0))
    assert (found.keypoints is not None) is verify


@pytest.mark.parametrize(
    ('threads', 'verify', 'expected'),
    [(1, True, 1), (2, True, 1), (4, True, 2), (5, True, 2), (4, False, 4), (1, False, 1)],
)
def test_half_of_the_threads_find_keypoints(threads, verify, expected):
    assert library_threads(BASE.replace(threads=threads, verify=verify)) == expected


def test_an_image_is_encoded_without_shift():
    shifted = new_recognizer(displacements_x=5, displacements_y=3).encode(texture(0))
    alone = new_recognizer(displacements_x=1, displacements_y=1).encode(texture(0))
    assert np.allclose(shifted, alone, atol=1e-6)


def test_static_content_is_counted_of_what_is_stored(monkeypatch):
    """Not of what was observed last: some evaluations observe all images before they store one."""
    keypoints = create_extractor('rootsift', image_width=320, max_features=300)
    recognizer, counted = assemble(BASE, CellExtractor(), keypoints), []
    monkeypatch.setattr(StaticContent, 'count', lambda content, codes: counted.append(codes))
    images = [cv2.resize(texture(place), (320, 240)) for place in range(3)]
    observed = [recognizer.observe(Frame(n * S, image)) for n, image in enumerate(images)]
    for observation in observed:
        recognizer.store(observation)
    assert len(counted) == 3
    for codes, observation in zip(counted, observed, strict=True):
        found = observation.query.keypoints
        symbols = recognizer._encoder.hasher.symbols(found.descriptors[:KEYPOINTS])
        expected = StaticContent().codes(symbols, found.points[:KEYPOINTS])
        assert np.array_equal(codes, expected)


def test_what_features_without_a_grid_go_without_is_said_once(caplog):
    caplog.set_level('INFO', 'hdc_place_recognition.recognition.image_encoder')
    recognizer = create_recognizer(BASE.replace(extractor='rootsift', verify=False))
    caplog.clear()
    for place in range(3):
        assert recognizer._encoder.encode(texture(place)).grid is None
    (line,) = [record.getMessage() for record in caplog.records]
    assert 'are no grid' in line and line.startswith('the features "rootsift')


def test_a_clock_set_back_begins_a_session_that_closures_name():
    recognizer = new_recognizer()
    for lap in range(2):
        found = [recognizer.process(Frame(n * S, texture(n))) for n in range(10)][-1]
        assert recognizer.traverse().session == lap
    best = found.accepted[0]
    assert (best.query_stamp_ns, best.match_stamp_ns) == (9 * S, 9 * S)
    assert (best.query_session, best.match_session) == (1, 0)


def test_sessions_keep_camera_and_odometry_and_share_nothing_else():
    recognizer = new_recognizer()
    first = recognizer.traverse()
    first.odometry = lambda stamp_ns: None
    drive([1, 2], recognizer)
    assert recognizer.begins_session(0) and not recognizer.begins_session(2 * S)
    recognizer.process(Frame(0, texture(3)))
    second = recognizer.traverse()
    assert second is not first and second.odometry is first.odometry
    assert recognizer.database.near(2, 1) == ()


def test_cameras_of_a_robot_have_the_same_sessions():
    recognizer = new_recognizer()
    for stamp in (5 * S, 0):
        recognizer.process(Frame(stamp, texture(0), 'left'))
    recognizer.process(Frame(0, texture(0), 'right'))
    assert recognizer.traverse('left').session == recognizer.traverse('right').session == 1


def test_a_stamp_in_the_future_makes_no_keyframe_old():
    recognizer = new_recognizer()
    drive([0, 1, 2], recognizer)
    found = recognizer.process(Frame(9_999 * S, texture(1)))
    assert found.status is Status.DATABASE_TOO_YOUNG
    after = [recognizer.process(Frame(n * S, texture(1))) for n in (4, 5)]
    assert not any(detection.accepted for detection in after)


def test_frames_without_stamps_are_processed_in_order_of_arrival():
    recognizer = new_recognizer(exclude_recent_s=1.0)
    found = [recognizer.process(Frame(0, texture(n % 15))) for n in range(20)]
    assert found[-1].accepted[0].match_id == 4
