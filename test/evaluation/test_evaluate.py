# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The recognizer run on small data sets: what is compared with what, and what is counted."""

from dataclasses import dataclass

from conftest import CellExtractor, texture
from hdc_place_recognition.datasets.dataset import Dataset, Mode, Truth
from hdc_place_recognition.datasets.ground_truth import MatrixTruth
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.evaluate import evaluate, STAGES
from hdc_place_recognition.evaluation.metrics import Verdict
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
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
    """Images of numbered places, one a second or at the stamps given; BLANK shows nothing."""

    places: tuple[int, ...]
    stamps_ns: tuple[int, ...] = ()

    def __len__(self):
        return len(self.places)

    def __iter__(self):
        stamps = self.stamps_ns or range(0, len(self) * S, S)
        for stamp_ns, place in zip(stamps, self.places, strict=True):
            yield stamp_ns, np.zeros((48, 64), np.uint8) if place == BLANK else texture(place)


def same_place(queries, database, stamps=lambda count: np.arange(count) * S):
    """Return ground truth by the numbers of the places; blanks are there too."""
    hard = np.equal.outer(np.array(queries), np.array(database))
    return MatrixTruth(Truth(hard, hard), stamps(len(queries)), stamps(len(database)))


def sequence(places, **details):
    return Dataset(
        'loop', Mode.SEQUENCE, Places(places), None, same_place(places, places), **details
    )


def recognizer(**changes):
    return PlaceRecognizer(BASE.replace(**changes), CellExtractor())


def test_sequence_finds_its_loop():
    result = evaluate(sequence((0, 1, 2, 3, 4, 0, 1)), recognizer())
    ranking, closures = result.judgement.ranking, result.judgement.closures
    assert ranking.average_precision == ranking.recall_at_1 == 1.0
    assert ranking.recall_at_full_precision == ranking.area_best_match == 1.0
    assert (closures.true, closures.false, closures.ignored) == (2, 0, 0)
    assert (closures.queries_with_match, closures.precision, closures.recall) == (2, 1.0, 1.0)


def test_sequence_compares_only_with_images_old_enough():
    result = evaluate(sequence((0, 0, 0, 0, 0)), recognizer())
    # Image i with j if at least 3 s lie between them, whatever they show.
    expected = np.array([[i - j >= 3 for j in range(5)] for i in range(5)])
    np.testing.assert_array_equal(result.recording.eligible, expected)
    assert result.judgement.closures.queries_with_match == 2
    # A pair's similarity stands where it belongs, everything else is left out.
    assert (result.judgement.pairs.similarities[expected] > -1).all()


def test_sequence_is_causal():
    places = (0, 1, 2, 3, 4, 0, 1, 2)
    longer = evaluate(sequence((*places, 7, 8)), recognizer()).recording
    shorter = evaluate(sequence(places), recognizer()).recording
    n = len(places)
    np.testing.assert_array_equal(longer.similarity_matrix()[:n, :n], shorter.similarity_matrix())
    assert longer.detections[:n] == shorter.detections


def test_evaluation_is_the_recognizer_itself():
    places = (0, 1, 2, 3, 4, 0, 1)
    online = recognizer()
    said = [online.process(stamp, image) for stamp, image in Places(places)]
    recording = evaluate(sequence(places), recognizer()).recording
    assert list(recording.detections) == said
    for offline, node in zip(recording.detections, said, strict=True):
        np.testing.assert_array_equal(offline.similarities, node.similarities)


def test_image_without_features_is_never_found_and_finds_nothing():
    result = evaluate(sequence((0, BLANK, 2, 3, 4, BLANK, 2)), recognizer())
    matrix, recording = result.recording.similarity_matrix(), result.recording
    assert recording.rows.tolist() == [0, -1, 1, 2, 3, -1, 4]
    # Row 5 asks nothing and column 1 holds nothing, and yet both count: they were to be found.
    assert (matrix[5] == -1).all() and (matrix[:, 1] == -1).all()
    assert recording.eligible[5].tolist() == [True, True, True, False, False, False, False]
    assert recording.eligible[6, 1]
    assert result.judgement.closures.queries_with_match == 2
    assert result.judgement.ranking.recall_at_1 == pytest.approx(1 / 2)
    # The later images are still in their columns: 2 is found in the third.
    assert recording.cells(accepted_only=True) == [(6, 2)]


def test_images_passed_over_are_no_rows():
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
    assert result.recording.query_stamps_ns.tolist() == [n * S for n in range(7)]
    assert (result.cost.images, result.cost.images_passed_over) == (7, 7)
    assert result.judgement.ranking.average_precision == 1.0
    assert result.judgement.closures.true == 2


def test_stamps_that_repeat_or_go_back_are_passed_over():
    dataset = Dataset('bad', Mode.SEQUENCE, Places((0, 1, 2, 3), (0, S, S, S - 1)))
    result = evaluate(dataset, recognizer())
    assert result.recording.query_stamps_ns.tolist() == [0, S]
    assert result.cost.images_passed_over == 2


def traverses(queries, reference):
    truth = same_place(queries, reference)
    return Dataset('two', Mode.TRAVERSES, Places(queries), Places(reference), truth)


def test_queries_are_asked_and_not_learned():
    one = recognizer(exclude_recent_s=1000.0)
    result = evaluate(traverses((2, 0, 7), (0, 1, 2, 3)), one)
    assert len(one.database) == 4
    assert result.recording.eligible.shape == (3, 4) and result.recording.eligible.all()
    assert [said.keyframe_id for said in result.recording.detections] == [None] * 3
    assert result.recording.cells(accepted_only=True) == [(0, 2), (1, 0)]
    closures = result.judgement.closures
    assert (closures.true, closures.queries_with_match, closures.recall) == (2, 2, 1.0)
    assert result.cost.images == 7


def test_queries_do_not_depend_on_each_other():
    # The running mean would be another one.
    plain = {'center_database': False}
    forward = evaluate(traverses((0, 1, 2), (0, 1, 2, 3)), recognizer(**plain))
    backward = evaluate(traverses((2, 1, 0), (0, 1, 2, 3)), recognizer(**plain))
    np.testing.assert_array_equal(
        forward.recording.similarity_matrix(), backward.recording.similarity_matrix()[::-1]
    )


def test_sequence_of_queries_does_not_continue_the_reference():
    changes = {'sequence_length': 3, 'center_database': False}
    result = evaluate(traverses((5,), (0, 1, 2, 3)), recognizer(**changes))
    # The first query is a sequence of one image, and so is the first image of a new recognizer.
    alone = recognizer(**changes).describe(0, texture(5))
    taught = recognizer(**changes)
    for place in range(4):
        taught.learn(taught.describe(place * S, texture(place)))
    np.testing.assert_array_equal(
        result.recording.detections[0].similarities, taught.recognize(alone).similarities
    )


def test_traverses_select_images_by_stamp_each_for_itself():
    stamps = (0, S // 2, S)
    images = Places((0, 1, 2), stamps)
    dataset = Dataset('two', Mode.TRAVERSES, images, images)
    result = evaluate(dataset, recognizer(min_interval_s=1.0))
    assert result.recording.query_stamps_ns.tolist() == [0, S]
    assert result.recording.database_stamps_ns.tolist() == [0, S]
    assert result.cost.images_passed_over == 2


def test_retrieval_compares_with_all_others():
    places = (0, 1, 0, BLANK, 1)
    dataset = Dataset('all', Mode.RETRIEVAL, Places(places), None, same_place(places, places))
    result = evaluate(dataset, recognizer(exclude_recent_s=1000.0))
    np.testing.assert_array_equal(result.recording.eligible, ~np.eye(5, dtype=bool))
    # Both of each pair find the other one, and nobody finds himself.
    assert result.recording.cells(accepted_only=True) == [(0, 2), (1, 4), (2, 0), (4, 1)]
    assert all(said.candidates for said in result.recording.detections[:3])
    assert result.judgement.ranking.average_precision == 1.0
    assert result.judgement.closures.queries_with_match == 4


def test_soft_pairs_are_ignored_in_verdicts():
    places = (0, 1, 2, 3, 4, 0, 1, 2)
    hard = np.equal.outer(np.array(places), np.array(places))
    soft = hard.copy()
    hard[6] = False  # 1 again: only soft
    hard[7] = soft[7] = False  # 2 again: the truth denies it
    truth = MatrixTruth(Truth(hard, soft), *[np.arange(8) * S] * 2)
    result = evaluate(Dataset('soft', Mode.SEQUENCE, Places(places), None, truth), recognizer())
    accepted = [
        verdict
        for candidate, verdict in zip(result.candidates, result.verdicts, strict=True)
        if candidate.accepted
    ]
    assert accepted == [Verdict.TRUE, Verdict.IGNORED, Verdict.FALSE]
    closures = result.judgement.closures
    assert (closures.true, closures.ignored, closures.false) == (1, 1, 1)
    assert (closures.precision, closures.recall, closures.queries_with_match) == (0.5, 1.0, 1)


def test_without_ground_truth():
    places = (0, 1, 2, 3, 4, 0)
    result = evaluate(Dataset('unknown', Mode.SEQUENCE, Places(places)), recognizer())
    assert result.judgement is None
    assert [candidate.match_id for candidate in result.candidates if candidate.accepted] == [0]
    assert list(result.verdicts) == [None] * len(result.candidates)


def test_cost():
    result = evaluate(sequence((0, BLANK, 2, 3)), recognizer()).cost
    assert result.images == 4
    assert result.features_per_image == 12.0  # 16 of three, none of the blank one
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


def test_progress_goes_through_all_images():
    seen = []

    def watch(frames, label):
        for frame in frames:
            seen.append((label, frame[0]))
            yield frame

    evaluate(traverses((0,), (0, 1)), recognizer(), watch)
    assert seen == [('two reference', 0), ('two reference', S), ('two', 0)]


def test_nothing_to_evaluate():
    with pytest.raises(PlaceRecognitionError, match='empty: no image was processed'):
        evaluate(Dataset('empty', Mode.SEQUENCE, Places(())), recognizer())


@pytest.mark.parametrize(('name', 'limit'), [('max_keyframes', 5), ('max_database_mb', 5.0)])
def test_database_must_not_forget(name, limit):
    forgetful = recognizer(**{name: limit})
    with pytest.raises(PlaceRecognitionError, match=f'{name} 5: an evaluation needs all'):
        evaluate(sequence((0, 1)), forgetful)


def test_database_must_be_empty():
    used = recognizer()
    used.process(0, texture(1))
    with pytest.raises(PlaceRecognitionError, match='already holds 1 images'):
        evaluate(sequence((0, 1)), used)
