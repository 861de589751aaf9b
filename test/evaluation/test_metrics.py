# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Metrics against values computed by hand, by definition, and by scikit-learn."""

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation import metrics
from hdc_place_recognition.evaluation.metrics import count_closures, Label, label_matches, Pairs
import numpy as np
import pytest

# Six queries (rows), three database images. H: hard, s: soft only, -: not eligible, .: different.
#
#        d0     d1     d2
TABLE = (
    ('0.9 H', '0.2 .', '0.1 .'),  # best match correct
    ('0.8 .', '0.7 H', '0.1 .'),  # best match wrong, hard match second
    ('0.6 H', '0.5 H', '0.4 .'),  # two hard matches
    ('0.3 .', '0.2 .', '0.1 .'),  # no match
    ('0.9 s', '0.3 .', '0.2 H'),  # best match soft only, ignored
    ('0.9 -', '0.1 .', '0.1 -'),  # one pair compared
)
# Pairs that are not ignored, by decreasing similarity:
#   0.9 H | 0.8 . | 0.7 H | 0.6 H | 0.5 H | 0.4 . | 0.3 . . | 0.2 H . . | 0.1 . . . .
# retrieved 1     2       3       4       5       6       8         11          15
# true      1     1       2       3       4       4       4          5           5
ALL_PAIRS = {
    'thresholds': [0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1],
    'precision': [1, 1 / 2, 2 / 3, 3 / 4, 4 / 5, 4 / 6, 4 / 8, 5 / 11, 5 / 15],
    'recall': [0.2, 0.2, 0.4, 0.6, 0.8, 0.8, 0.8, 1.0, 1.0],
}
# Best match per query, by decreasing similarity: q0 0.9 correct, q1 0.8 wrong, q2 0.6 correct,
# q3 0.3 and q4 0.3 wrong, q5 0.1 wrong. Queries with a match: q0 q1 q2 q4.
BEST_MATCH = {
    'thresholds': [0.9, 0.8, 0.6, 0.3, 0.1],
    'precision': [1, 1 / 2, 2 / 3, 2 / 5, 2 / 6],
    'recall': [1 / 4, 1 / 4, 2 / 4, 2 / 4, 2 / 4],
}


def pairs_of(table):
    """Return the pairs of a table."""
    cells = np.array([[cell.split() for cell in row] for row in table])
    kind = cells[..., 1]
    return Pairs(
        similarities=cells[..., 0].astype(np.float32),
        hard=kind == 'H',
        soft=(kind == 'H') | (kind == 's'),
        eligible=kind != '-',
    )


PAIRS = pairs_of(TABLE)


@pytest.mark.parametrize(
    'curve, expected',
    [
        (metrics.precision_recall(PAIRS), ALL_PAIRS),
        (metrics.best_match_curve(PAIRS), BEST_MATCH),
    ],
    ids=['all pairs', 'best match'],
)
def test_curve_by_hand(curve, expected):
    for name, values in expected.items():
        np.testing.assert_allclose(getattr(curve, name), values, rtol=1e-6, err_msg=name)


def test_areas_by_hand():
    # Steps of recall 0.2, with the precision where recall increases.
    assert metrics.average_precision(PAIRS) == pytest.approx(
        0.2 * (1 + 2 / 3 + 3 / 4 + 4 / 5 + 5 / 11)
    )
    assert metrics.area_best_match(PAIRS) == pytest.approx(1 / 4 * 1 + 1 / 4 * 2 / 3)
    # Only 0.9 has precision 1 among the best matches.
    assert metrics.recall_at_full_precision(PAIRS) == pytest.approx(1 / 4)


def test_steps_have_the_same_area():
    curve = metrics.precision_recall(PAIRS)
    np.testing.assert_allclose(curve.steps().recall, [0.2, 0.4, 0.6, 0.8, 1.0])
    assert curve.steps().area == pytest.approx(curve.area)


def test_recall_at_k_by_hand():
    # Rank of the best hard match: q0 1, q1 2, q2 1, q4 2 (soft only not ranked); q3, q5 have none.
    assert metrics.recall_at_k(PAIRS, 1) == pytest.approx(2 / 4)
    assert metrics.recall_at_k(PAIRS, 2) == 1.0


def test_ties_are_one_step_and_rank_wrong_images_first():
    tied = pairs_of([('0.5 H', '0.5 .', '0.1 .')])
    curve = metrics.precision_recall(tied)
    np.testing.assert_allclose(curve.precision, [1 / 2, 1 / 3])
    np.testing.assert_allclose(curve.recall, [1, 1])
    assert metrics.average_precision(tied) == pytest.approx(1 / 2)
    assert metrics.recall_at_k(tied, 1) == 0.0
    assert metrics.recall_at_k(tied, 2) == 1.0
    assert metrics.area_best_match(tied) == 0.0
    assert metrics.recall_at_full_precision(tied) == 0.0


def test_metrics_do_not_depend_on_the_order():
    rng = np.random.default_rng(1)
    coarse = rng.integers(0, 4, (12, 9)).astype(np.float32)  # many ties
    hard, soft, eligible = rng.random((3, 12, 9)) < [[[0.2]], [[0.4]], [[0.8]]]
    rows, columns = rng.permutation(12)[:, None], rng.permutation(9)
    pairs = Pairs(coarse, hard, soft, eligible)
    shuffled = Pairs(*(matrix[rows, columns] for matrix in (coarse, hard, soft, eligible)))
    for metric in (
        metrics.average_precision,
        metrics.average_precision_100,
        metrics.area_best_match,
        metrics.recall_at_full_precision,
        lambda pairs: metrics.recall_at_k(pairs, 3),
    ):
        assert metric(pairs) == pytest.approx(metric(shuffled))


def test_average_precision_follows_its_definition():
    rng = np.random.default_rng(2)
    scores = rng.integers(0, 30, (20, 20)).astype(np.float32)
    hard = rng.random((20, 20)) < 0.1
    everything = np.ones_like(hard)
    area, last_recall = 0.0, 0.0
    for threshold in sorted(set(scores.ravel()), reverse=True):
        retrieved = scores >= threshold
        true = np.count_nonzero(retrieved & hard)
        area += (true / hard.sum() - last_recall) * true / retrieved.sum()
        last_recall = true / hard.sum()
    pairs = Pairs(scores, hard, hard, everything)
    assert metrics.average_precision(pairs) == pytest.approx(area)


@pytest.mark.parametrize('levels', [10, 2**24], ids=['many ties', 'few ties'])
def test_average_precision_equals_that_of_scikit_learn(levels):
    oracle = pytest.importorskip('sklearn.metrics').average_precision_score
    rng = np.random.default_rng(4)
    similarities = rng.integers(0, levels, (30, 40)).astype(np.float32) / levels
    hard, soft, eligible = rng.random((3, 30, 40)) < [[[0.1]], [[0.2]], [[0.7]]]
    kept = eligible & (hard | ~soft)
    expected = oracle(hard[kept], similarities[kept])
    pairs = Pairs(similarities, hard, soft, eligible)
    assert metrics.average_precision(pairs) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize('levels', [10, 2**24], ids=['many ties', 'few ties'])
def test_curve_equals_that_of_scikit_learn(levels):
    oracle = pytest.importorskip('sklearn.metrics').precision_recall_curve
    rng = np.random.default_rng(5)
    similarities = rng.integers(0, levels, (20, 20)).astype(np.float32) / levels
    hard = rng.random((20, 20)) < 0.2
    precision, recall, thresholds = oracle(hard.ravel(), similarities.ravel())
    curve = metrics.precision_recall(Pairs(similarities, hard, hard, np.ones_like(hard)))
    # scikit-learn sorts thresholds in increasing order and adds the point (0, 1) at the end.
    np.testing.assert_allclose(curve.thresholds, thresholds[::-1])
    np.testing.assert_allclose(curve.precision, precision[-2::-1])
    np.testing.assert_allclose(curve.recall, recall[-2::-1])


def test_average_precision_100_is_the_trapezoid_over_100_thresholds():
    rng = np.random.default_rng(3)
    scores = rng.random((15, 15), np.float32)
    hard = rng.random((15, 15)) < 0.2
    recall, precision = [0.0], [1.0]
    for threshold in np.linspace(np.float64(scores.max()), np.float64(scores.min()), 100):
        retrieved = scores.astype(np.float64) >= threshold
        true = np.count_nonzero(retrieved & hard)
        recall.append(true / hard.sum())
        precision.append(true / retrieved.sum())
    area = sum(
        (recall[n] - recall[n - 1]) * (precision[n] + precision[n - 1]) / 2 for n in range(1, 101)
    )
    pairs = Pairs(scores, hard, hard, np.ones_like(hard))
    assert metrics.average_precision_100(pairs) == pytest.approx(area)


ALL_METRICS = (
    metrics.average_precision,
    metrics.average_precision_100,
    metrics.recall_at_full_precision,
    metrics.area_best_match,
    lambda pairs: metrics.recall_at_k(pairs, 1),
)


@pytest.mark.parametrize('metric', ALL_METRICS)
@pytest.mark.parametrize(
    'table',
    [
        [('0.5 .', '0.1 s')],  # no hard pair
        [('0.5 -', '0.1 -')],  # nothing compared
        np.empty((0, 0, 2)),
    ],
    ids=['no positives', 'none eligible', 'empty'],
)
def test_metrics_without_matches_are_none(metric, table):
    if len(table):
        pairs = pairs_of(table)
    else:
        nothing = np.zeros((0, 0), np.bool_)
        pairs = Pairs(np.zeros((0, 0), np.float32), nothing, nothing, nothing)
    assert metric(pairs) is None


def test_a_hard_pair_that_is_not_eligible_does_not_count():
    assert metrics.average_precision(pairs_of([('0.9 .', '0.5 H')])) == pytest.approx(1 / 2)
    skipped = pairs_of([('0.9 .', '0.5 H')])
    skipped = Pairs(skipped.similarities, skipped.hard, skipped.soft, ~skipped.hard)
    assert metrics.average_precision(skipped) is None


@pytest.mark.parametrize('metric', ALL_METRICS)
def test_only_matches_give_1(metric):
    assert metric(pairs_of([('0.5 H', '0.1 H'), ('0.4 H', '0.4 H')])) == 1.0


def test_metrics_do_not_change_their_input():
    before = [np.array(getattr(PAIRS, name)) for name in ('similarities', 'hard', 'soft')]
    for metric in ALL_METRICS:
        metric(PAIRS)
    for name, copy in zip(('similarities', 'hard', 'soft'), before, strict=True):
        np.testing.assert_array_equal(getattr(PAIRS, name), copy)


def test_shapes_must_fit():
    square = np.ones((2, 2), np.bool_)
    with pytest.raises(PlaceRecognitionError, match=r'soft has shape \(2, 3\).*\(2, 2\)'):
        Pairs(square.astype(np.float32), square, np.ones((2, 3), np.bool_), square)


def test_nan_of_an_eligible_pair_is_an_error():
    similarities = np.array([[np.nan, 0.5]], np.float32)
    known = np.array([[False, True]])
    assert metrics.average_precision(Pairs(similarities, known, known, known)) == 1.0
    with pytest.raises(PlaceRecognitionError, match='NaN'):
        Pairs(similarities, known, known, np.ones_like(known))


def test_closures_by_hand():
    # q0 true; q1 false and true; q2 true twice; q3 false; q4 soft only.
    accepted = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (3, 2), (4, 0)]
    closures = count_closures(accepted, PAIRS.hard, PAIRS.soft, PAIRS.has_match)
    assert (closures.true, closures.false, closures.ignored) == (4, 2, 1)
    assert closures.precision == pytest.approx(4 / 6)
    # q0, q1, q2 and q4 have a match; q4 has no true closure.
    assert closures.queries_with_match == 4
    assert closures.recall == pytest.approx(3 / 4)


def test_labels():
    labels = label_matches([(0, 0), (4, 0), (4, 1)], PAIRS.hard, PAIRS.soft)
    assert labels == [Label.TRUE, Label.IGNORED, Label.FALSE]


def test_precision_is_none_without_accepted_closures():
    closures = count_closures([], PAIRS.hard, PAIRS.soft, PAIRS.has_match)
    assert closures.precision is None
    assert closures.recall == 0.0


def test_precision_is_none_if_all_closures_are_ignored():
    closures = count_closures([(4, 0)], PAIRS.hard, PAIRS.soft, PAIRS.has_match)
    assert closures.precision is None
    assert closures.ignored == 1


def test_recall_is_none_without_matches():
    nowhere = np.zeros_like(PAIRS.hard)
    closures = count_closures([(0, 0)], nowhere, nowhere, nowhere.any(axis=1))
    assert closures.recall is None
    assert closures.precision == 0.0
