# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The recogniser as the node and the offline tools use it."""

from conftest import CellExtractor, texture
import cv2
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import create_recognizer
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
from hdc_place_recognition.results import Detection, NOT_VERIFIED, Status
import numpy as np
import pytest

S = 1_000_000_000
BASE = Params(dimensions=1024, min_interval_s=0.5, exclude_recent_s=5.0, min_score=0.8)


def recognizer(**changes: object) -> PlaceRecognizer:
    return PlaceRecognizer(BASE.replace(**changes), CellExtractor())


def drive(places: list[int], one: PlaceRecognizer | None = None) -> list[Detection]:
    """Visit places, one a second."""
    one = one or recognizer()
    return [one.process(index * S, texture(place)) for index, place in enumerate(places)]


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
    detections = drive([3, 1, 2, *[3] * 5], recognizer(top_k=1))
    assert detections[-1].candidates[0].match_id == 0


def test_exclusion_by_count():
    found = drive([3, 1, 2, 3], recognizer(exclude_recent_s=0.0, exclude_recent_frames=2))[-1]
    assert [candidate.match_id for candidate in found.candidates] == [0]
    assert len(found.similarities) == 1


def test_whole_row_of_similarities_and_top_k():
    found = drive(list(range(32)), recognizer(top_k=3))[-1]
    assert found.similarities.shape == (27,)
    rows = [candidate.match_id for candidate in found.candidates]
    # The best, and the best of those that are not next to it.
    assert rows[0] == found.similarities.argmax() and len(rows) == 3
    assert np.diff(sorted(rows)).min() > 3
    similarities = [candidate.similarity for candidate in found.candidates]
    assert similarities == sorted(similarities, reverse=True)
    assert similarities == found.similarities[rows].tolist()


def test_live_parameter_takes_effect_with_the_next_image():
    one = recognizer()
    drive([*range(10), 3], one)
    one.params = one.params.replace(min_score=0.0)
    found = one.process(20 * S, texture(99))
    assert found.status is Status.ACCEPTED and found.accepted == found.candidates


def test_images_too_near_are_passed_over():
    one = recognizer()
    first, second = one.process(0, texture(0)), one.process(S // 4, texture(0))
    assert first.status is Status.DATABASE_TOO_YOUNG
    assert second.status is Status.TOO_SOON and second.keyframe_id is None
    assert len(one.database) == 1


def test_blank_image_is_answered_and_not_stored():
    one = recognizer()
    drive(list(range(8)), one)
    found = one.process(9 * S, np.zeros((48, 64), np.uint8))
    assert found.status is Status.NO_FEATURES and found.candidates == ()
    assert found.keyframe_id is None and len(one.database) == 8
    assert np.isfinite(found.similarities).all()


@pytest.mark.parametrize(
    'image', [texture(1), texture(1).astype(np.uint16) * 257, np.dstack([texture(1)] * 3)]
)
def test_grey_16_bit_and_colour_are_the_same_place(image):
    one = recognizer()
    drive(list(range(8)), one)
    assert one.process(9 * S, image).candidates[0].match_id == 1


def test_no_image_is_an_error_and_changes_nothing():
    one = recognizer()
    with pytest.raises(PlaceRecognitionError, match='image'):
        one.process(5 * S, np.zeros((3, 4, 5, 6), np.uint8))
    assert one.process(5 * S, texture(0)).keyframe_id == 0


def test_clock_set_back_keeps_the_places():
    one = recognizer()
    drive(list(range(10)), one)
    found = one.process(0, texture(2))
    assert found.status is Status.ACCEPTED and found.candidates[0].match_id == 2


def test_sequences_tell_look_alikes_apart():
    # Places 0-4, then 10, 11, 2: alone the last image fits; with what came before it does not.
    places = [0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 2]
    alone, together = drive(places)[-1], drive(places, recognizer(sequence_length=3))[-1]
    assert alone.status is Status.ACCEPTED
    assert together.status is Status.BELOW_THRESHOLD
    again = drive([0, 1, 2, 3, 4, 5, 6, 7, 8, 0, 1, 2], recognizer(sequence_length=3))[-1]
    assert again.status is Status.ACCEPTED and again.candidates[0].match_id == 2


def test_two_traverses_and_retrieval():
    one = recognizer()
    descriptions = [one.describe(index * S, texture(index)) for index in range(6)]
    assert [one.learn(description) for description in descriptions] == list(range(6))
    one.start_sequence()
    asked = one.recognize(one.describe(0, texture(4)))
    assert asked.candidates[0].match_id == 4 and asked.keyframe_id is None
    assert len(one.database) == 6 and asked.similarities.shape == (6,)
    skipped = one.recognize(descriptions[4], skip_id=4)
    assert 4 not in [candidate.match_id for candidate in skipped.candidates]
    assert skipped.candidates and skipped.candidates[0].score < 0.8


def test_same_input_same_output():
    first, again = drive([*range(10), 3]), drive([*range(10), 3])
    assert first == again
    assert np.array_equal(first[-1].similarities, again[-1].similarities)


def test_database_names_its_features():
    assert recognizer().database.extractor == 'cells'


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
        found, expected = (one.process(index * S, image) for one in (warm, cold))
        assert found == expected
        assert np.array_equal(found.similarities, expected.similarities)
    assert found.candidates[0].inliers != NOT_VERIFIED


def test_warm_up_has_seen_to_everything():
    one = recognizer()
    one.warm_up(64, 48)
    assert one._looker._encoder.projection.cache_info().currsize == 1
