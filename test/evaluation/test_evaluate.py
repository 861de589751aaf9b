# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Evaluation of small datasets: which pairs are compared, and which are counted."""

from dataclasses import dataclass

from conftest import CellExtractor, texture
import cv2
from hdc_place_recognition.datasets.dataset import Dataset, Mode, Truth
from hdc_place_recognition.datasets.ground_truth import MatrixTruth
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.evaluate import evaluate, evaluate_input, STAGES
from hdc_place_recognition.evaluation.metrics import Label
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import assemble
from hdc_place_recognition.results import Frame
import numpy as np
import pytest

S = 10**9
BLANK = -1
BASE = Params(
    dimensions=512,
    min_interval_s=0.0,
    exclude_recent_s=3.0,
    min_score=0.8,
    keyframe_similarity=1.0,
    top_k=2,
)


@dataclass(frozen=True)
class Places:
    """Images of numbered places at 1 Hz or at given stamps; BLANK is an image without features."""

    places: tuple[int, ...]
    stamps_ns: tuple[int, ...] = ()

    def __len__(self):
        return len(self.places)

    def __iter__(self):
        stamps = self.stamps_ns or range(0, len(self) * S, S)
        for stamp_ns, place in zip(stamps, self.places, strict=True):
            image = np.zeros((48, 64), np.uint8) if place == BLANK else texture(place)
            yield Frame(stamp_ns, image)


def same_place(queries, database, stamps=lambda count: np.arange(count) * S):
    """Return ground truth from place numbers; BLANK counts as a place."""
    hard = np.equal.outer(np.array(queries), np.array(database))
    return MatrixTruth(Truth(hard, hard), stamps(len(queries)), stamps(len(database)))


def sequence(places, **details):
    return Dataset(
        'loop', Mode.SEQUENCE, Places(places), None, same_place(places, places), **details
    )


def recognizer(**changes):
    return assemble(BASE.replace(**changes), CellExtractor())


def test_sequence_finds_its_loop():
    result = evaluate(sequence((0, 1, 2, 3, 4, 0, 1)), recognizer())
    ranking, closures = result.scores.ranking, result.scores.closures
    assert ranking.average_precision == ranking.recall_at_1 == 1.0
    assert ranking.recall_at_full_precision == ranking.area_best_match == 1.0
    assert (closures.true, closures.false, closures.ignored) == (2, 0, 0)
    assert (closures.queries_with_match, closures.precision, closures.recall) == (2, 1.0, 1.0)


def test_sequence_compares_only_with_images_old_enough():
    result = evaluate(sequence((0, 0, 0, 0, 0)), recognizer())
    # Image i is compared with j if j is at least 3 s older.
    expected = np.array([[i - j >= 3 for j in range(5)] for i in range(5)])
    np.testing.assert_array_equal(result.run_log.eligible, expected)
    assert result.scores.closures.queries_with_match == 2
    # Every eligible pair has a similarity.
    assert (result.scores.pairs.similarities[expected] > -1).all()


def test_sequence_is_causal():
    places = (0, 1, 2, 3, 4, 0, 1, 2)
    longer = evaluate(sequence((*places, 7, 8)), recognizer()).run_log
    shorter = evaluate(sequence(places), recognizer()).run_log
    n = len(places)
    np.testing.assert_array_equal(longer.similarity_matrix()[:n, :n], shorter.similarity_matrix())
    assert longer.detections[:n] == shorter.detections


def test_evaluation_equals_online_processing():
    places = (0, 1, 2, 3, 4, 0, 1)
    online = recognizer()
    detections = [online.process(frame) for frame in Places(places)]
    run_log = evaluate(sequence(places), recognizer()).run_log
    assert list(run_log.detections) == detections
    for offline, node in zip(run_log.detections, detections, strict=True):
        np.testing.assert_array_equal(offline.similarities, node.similarities)


def test_an_image_without_features_counts_for_recall():
    result = evaluate(sequence((0, BLANK, 2, 3, 4, BLANK, 2)), recognizer())
    matrix, run_log = result.run_log.similarity_matrix(), result.run_log
    assert run_log.keyframe_ids.tolist() == [0, -1, 1, 2, 3, -1, 4]
    # Image 1 cannot be found and image 5 cannot find it, but the pair counts for recall.
    assert (matrix[5] == -1).all() and (matrix[:, 1] == -1).all()
    assert run_log.eligible[5].tolist() == [True, True, True, False, False, False, False]
    assert run_log.eligible[6, 1]
    assert result.scores.closures.queries_with_match == 2
    assert result.scores.ranking.recall_at_1 == pytest.approx(1 / 2)
    # Images after the blank one keep their columns: query 6 finds image 2.
    assert run_log.cells(accepted_only=True) == [(6, 2)]


def test_skipped_images_have_no_row():
    stamps = tuple(n * S // 2 for n in range(14))
    places = tuple(n // 2 if n < 10 else n // 2 - 5 for n in range(14))
    dataset = Dataset(
        'halves',
        Mode.SEQUENCE,
        Places(places, stamps),
        None,
        same_place(places, places, lambda count: np.arange(count) * S // 2),
    )
    result = evaluate(dataset, recognizer(min_interval_s=1.0))
    assert result.run_log.query_stamps_ns.tolist() == [n * S for n in range(7)]
    assert (result.cost.images, result.cost.images_passed_over) == (7, 7)
    assert result.scores.ranking.average_precision == 1.0
    assert result.scores.closures.true == 2


def test_images_with_repeated_or_older_stamps_are_skipped():
    dataset = Dataset('bad', Mode.SEQUENCE, Places((0, 1, 2, 3), (0, S, S, S - 1)))
    result = evaluate(dataset, recognizer())
    assert result.run_log.query_stamps_ns.tolist() == [0, S]
    assert result.cost.images_passed_over == 2


def traverses(queries, reference):
    truth = same_place(queries, reference)
    return Dataset('two', Mode.TRAVERSES, Places(queries), Places(reference), truth)


def test_queries_are_not_stored():
    recognizer_ = recognizer(exclude_recent_s=1000.0)
    result = evaluate(traverses((2, 0, 7), (0, 1, 2, 3)), recognizer_)
    assert len(recognizer_.database) == 4
    assert result.run_log.eligible.shape == (3, 4) and result.run_log.eligible.all()
    assert [detection.keyframe_id for detection in result.run_log.detections] == [None] * 3
    assert result.run_log.cells(accepted_only=True) == [(0, 2), (1, 0)]
    closures = result.scores.closures
    assert (closures.true, closures.queries_with_match, closures.recall) == (2, 2, 1.0)
    assert result.cost.images == 7


def test_queries_do_not_depend_on_each_other():
    # Without the running mean, which depends on the order of the images.
    plain = {'center_database': False}
    forward = evaluate(traverses((0, 1, 2), (0, 1, 2, 3)), recognizer(**plain))
    backward = evaluate(traverses((2, 1, 0), (0, 1, 2, 3)), recognizer(**plain))
    np.testing.assert_array_equal(
        forward.run_log.similarity_matrix(), backward.run_log.similarity_matrix()[::-1]
    )


def test_sequences_of_queries_do_not_include_reference_images():
    changes = {'sequence_length': 3, 'center_database': False}
    result = evaluate(traverses((5,), (0, 1, 2, 3)), recognizer(**changes))
    # The first query is a sequence of one image, like the first image of a new recognizer.
    alone = recognizer(**changes).observe(Frame(0, texture(5)))
    reference = recognizer(**changes)
    for place in range(4):
        reference.store(reference.observe(Frame(place * S, texture(place))))
    np.testing.assert_array_equal(
        result.run_log.detections[0].similarities, reference.recognize(alone).similarities
    )


def test_both_traverses_skip_images_that_come_too_soon():
    stamps = (0, S // 2, S)
    images = Places((0, 1, 2), stamps)
    dataset = Dataset('two', Mode.TRAVERSES, images, images)
    result = evaluate(dataset, recognizer(min_interval_s=1.0))
    assert result.run_log.query_stamps_ns.tolist() == [0, S]
    assert result.run_log.database_stamps_ns.tolist() == [0, S]
    assert result.cost.images_passed_over == 2


def test_retrieval_compares_with_all_others():
    places = (0, 1, 0, BLANK, 1)
    dataset = Dataset('all', Mode.RETRIEVAL, Places(places), None, same_place(places, places))
    result = evaluate(dataset, recognizer(exclude_recent_s=1000.0))
    np.testing.assert_array_equal(result.run_log.eligible, ~np.eye(5, dtype=bool))
    # Images of the same place find each other, and no image finds itself.
    assert result.run_log.cells(accepted_only=True) == [(0, 2), (1, 4), (2, 0), (4, 1)]
    assert all(detection.candidates for detection in result.run_log.detections[:3])
    assert result.scores.ranking.average_precision == 1.0
    assert result.scores.closures.queries_with_match == 4


def test_candidates_of_soft_pairs_are_labeled_ignored():
    places = (0, 1, 2, 3, 4, 0, 1, 2)
    hard = np.equal.outer(np.array(places), np.array(places))
    soft = hard.copy()
    hard[6] = False  # place 1 again, soft only
    hard[7] = soft[7] = False  # place 2 again, a different place by ground truth
    truth = MatrixTruth(Truth(hard, soft), *[np.arange(8) * S] * 2)
    result = evaluate(Dataset('soft', Mode.SEQUENCE, Places(places), None, truth), recognizer())
    accepted = [
        label
        for candidate, label in zip(result.candidates, result.labels, strict=True)
        if candidate.accepted
    ]
    assert accepted == [Label.TRUE, Label.IGNORED, Label.FALSE]
    closures = result.scores.closures
    assert (closures.true, closures.ignored, closures.false) == (1, 1, 1)
    assert (closures.precision, closures.recall, closures.queries_with_match) == (0.5, 1.0, 1)


def test_without_ground_truth():
    places = (0, 1, 2, 3, 4, 0)
    result = evaluate(Dataset('unknown', Mode.SEQUENCE, Places(places)), recognizer())
    assert result.scores is None
    assert [candidate.match_id for candidate in result.candidates if candidate.accepted] == [0]
    assert list(result.labels) == [None] * len(result.candidates)


def test_cost():
    result = evaluate(sequence((0, BLANK, 2, 3)), recognizer()).cost
    assert result.images == 4
    assert result.features_per_image == 12.0  # 16 for three images, 0 for the blank image
    assert list(result.ms_per_image) == [*STAGES, 'total']
    assert all(result.ms_per_image[stage] > 0 for stage in ('read', 'extract', 'encode', 'query'))
    assert result.ms_per_image['keypoints'] == result.ms_per_image['verify'] == 0.0
    spent = [result.ms_per_image[stage] for stage in STAGES]
    assert result.ms_per_image['total'] == pytest.approx(sum(spent))
    assert result.database_bytes >= 3 * 512 * 4


@pytest.mark.parametrize('mode', [Mode.TRAVERSES, Mode.RETRIEVAL])
def test_insertion_is_timed_in_every_mode(mode):
    reference = Places((0, 1)) if mode is Mode.TRAVERSES else None
    result = evaluate(Dataset('timed', mode, Places((0, 1)), reference), recognizer()).cost
    assert all(result.ms_per_image[stage] > 0 for stage in set(STAGES) - {'keypoints', 'verify'})


def test_progress_wraps_all_images():
    seen = []

    def watch(frames, label):
        for frame in frames:
            seen.append((label, frame.stamp_ns))
            yield frame

    evaluate(traverses((0,), (0, 1)), recognizer(), watch)
    assert seen == [('two reference', 0), ('two reference', S), ('two', 0)]


def test_nothing_to_evaluate():
    with pytest.raises(PlaceRecognitionError, match='empty: no image was processed'):
        evaluate(Dataset('empty', Mode.SEQUENCE, Places(())), recognizer())


@pytest.mark.parametrize(('name', 'limit'), [('max_keyframes', 5), ('max_database_mb', 5.0)])
def test_database_must_not_have_a_limit(name, limit):
    limited = recognizer(**{name: limit})
    with pytest.raises(PlaceRecognitionError, match=f'{name} 5: an evaluation needs all images'):
        evaluate(sequence((0, 1)), limited)


def test_database_must_be_empty():
    used = recognizer()
    used.process(Frame(0, texture(1)))
    with pytest.raises(PlaceRecognitionError, match='already holds 1 images'):
        evaluate(sequence((0, 1)), used)


def write_folder(folder, places):
    """Write a folder of images of numbered places, without ground truth."""
    (folder / 'images').mkdir(parents=True)
    for number, frame in enumerate(Places(places)):
        cv2.imwrite(str(folder / 'images' / f'{number:02d}.png'), frame.image)
    return folder


SETTINGS = {'extractor': 'gradient_grid', 'dimensions': 512, 'verify': False}


def test_input_is_evaluated_by_path_options_and_parameters(tmp_path):
    folder = write_folder(tmp_path / 'loop', (0, 1, 2, 3, 4, 0))
    result = evaluate_input(str(folder), exclude_recent_s=3, **SETTINGS)
    # The dataset overrides the minimum interval: every image of a folder is processed.
    assert (result.params.exclude_recent_s, result.params.min_interval_s) == (3.0, 0.0)
    assert result.metrics['name'] == 'loop' and result.metrics['images'] == 6
    assert result.metrics['precision'] is None
    assert result.candidates[-1].query_stamp_ns == 5 * S


def test_input_is_compared_with_a_database(tmp_path):
    drive = write_folder(tmp_path / 'drive', (1, 2))
    database = write_folder(tmp_path / 'map', (0, 1, 2))
    result = evaluate_input(drive, database=database, **SETTINGS)
    best = [detection.candidates[0].match_id for detection in result.run_log.detections]
    assert best == [1, 2]


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'radius_m': 0.0}, '--radius 0: must be above 0'),
        ({'dimension': 64}, 'unknown parameter dimension'),
        ({}, 'nowhere does not exist'),
    ],
)
def test_invalid_input_options_and_parameters_are_errors(arguments, message):
    with pytest.raises(PlaceRecognitionError, match=message):
        evaluate_input('nowhere', **arguments)
