# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Path evidence: each rule on evidence made by hand."""

from __future__ import annotations

from hdc_place_recognition.verification.path import Background, PathFilter, PathMatch, PathSettings
import numpy as np
import pytest

GOOD, POOR = 5.5, 0.5
IDS = np.arange(100, 200)


def walk(
    path: PathFilter, rows: list[int], z: float = GOOD, ids: np.ndarray = IDS, novelty: float = 1.0
) -> list[PathMatch]:
    """Push images whose evidence has its peak at each of these rows."""
    return [push(path, {row: z}, ids, novelty) for row in rows]


def push(
    path: PathFilter, peaks: dict[int, float], ids: np.ndarray = IDS, novelty: float = 1.0
) -> PathMatch:
    evidence = {int(ids[r]): POOR for r in (0, len(ids) // 2, len(ids) - 1)}
    for row, z in peaks.items():
        evidence |= {int(ids[r]): z / 2 for r in (row - 1, row + 1) if 0 <= r < len(ids)}
        evidence[int(ids[row])] = z
    match = path.push(ids, evidence, list(evidence), novelty)
    assert match is not None
    return match


def test_one_image_alone_proves_nothing() -> None:
    match = walk(PathFilter(), [20], z=100)[0]
    assert match.keyframe_id == 120
    assert match.probability < 0.95


def test_a_path_of_good_images_is_accepted_and_grows() -> None:
    matches = walk(PathFilter(), list(range(20, 30)))
    probabilities = [match.probability for match in matches]
    assert probabilities[1] < 0.95 < probabilities[-1]
    assert matches[-1].keyframe_id == 129


@pytest.mark.parametrize('rows', [range(20, 50, 2), range(20, 65, 3), [20, 20, 21, 21, 22, 23]])
def test_speeds(rows: list[int]) -> None:
    path = PathFilter()
    assert walk(path, [*rows, rows[-1] + 1, rows[-1] + 2, rows[-1] + 3])[-1].probability > 0.95


def test_jumps_are_no_path() -> None:
    rows = [20, 60, 35, 80, 10, 70, 40, 90, 25, 55]
    assert max(match.probability for match in walk(PathFilter(), rows)) < 0.95


def test_a_path_must_advance_because_a_keyframe_testifies_once() -> None:
    assert max(match.probability for match in walk(PathFilter(), [20] * 30)) < 0.95


def test_an_image_that_shows_little_new_counts_little() -> None:
    rows = list(range(20, 30))
    new = walk(PathFilter(), rows)[-1]
    old = walk(PathFilter(), rows, novelty=0.1)[-1]
    assert new.probability > 0.95 > 0.2 > old.probability


def test_an_image_without_news_changes_nothing() -> None:
    path = PathFilter()
    before = walk(path, list(range(20, 30)))[-1]
    after = walk(path, [29], novelty=0.0)[-1]
    assert after.log_odds == pytest.approx(before.log_odds)


def test_poor_images_end_a_path() -> None:
    path = PathFilter()
    assert walk(path, list(range(20, 30)))[-1].probability > 0.95
    assert push(path, {}).probability < 0.95
    for _ in range(5):
        push(path, {})
    assert push(path, {37: GOOD}).probability < 0.95


def test_one_poor_image_does_not() -> None:
    path = PathFilter()
    walk(path, list(range(20, 32)))
    push(path, {32: 1.5})
    assert push(path, {33: GOOD}).probability > 0.9


def test_a_current_image_without_evidence_is_never_accepted() -> None:
    path = PathFilter()
    walk(path, list(range(20, 40)))
    assert push(path, {40: 2.4}).probability == 0


def test_two_places_that_look_alike_are_rivals() -> None:
    path = PathFilter()
    matches = [push(path, {20 + k: GOOD, 70 + k: GOOD - 0.1}) for k in range(15)]
    assert max(match.probability for match in matches) < 0.95
    assert matches[-1].rival > 0


def test_backwards_is_followed_but_not_accepted() -> None:
    matches = walk(PathFilter(), list(range(60, 30, -1)))
    assert max(match.probability for match in matches) < 0.95
    assert matches[-1].rival > matches[-1].log_odds


def test_the_path_and_the_best_image_must_agree() -> None:
    path = PathFilter()
    walk(path, list(range(20, 35)))
    match = push(path, {35: GOOD, 80: GOOD + 1})
    assert match.keyframe_id == 180
    assert match.probability < 0.95


def test_expected_keyframes_are_ahead_of_the_path() -> None:
    path = PathFilter()
    assert path.expected(IDS) == []
    walk(path, list(range(20, 30)))
    assert 130 in path.expected(IDS)
    assert len(path.expected(IDS, 2)) <= 6


def test_a_path_leaves_the_map_at_its_end() -> None:
    path = PathFilter()
    walk(path, list(range(90, 100)))
    assert all(keyframe_id in IDS for keyframe_id in path.expected(IDS))


def test_eviction_keeps_the_path() -> None:
    path = PathFilter()
    walk(path, list(range(20, 30)))
    kept = np.setdiff1d(IDS, [*range(100, 115), 128, 129])
    row = int(np.searchsorted(kept, 130))
    assert walk(path, [row], ids=kept)[-1].probability > 0.95


def test_added_keyframes_keep_the_path() -> None:
    path = PathFilter()
    walk(path, list(range(20, 30)))
    more = np.arange(100, 260)
    assert walk(path, [30], ids=more)[-1].probability > 0.95


def test_restart_forgets() -> None:
    path = PathFilter()
    walk(path, list(range(20, 30)))
    path.restart()
    assert walk(path, [30])[-1].probability < 0.95


def test_nothing_compared() -> None:
    path = PathFilter()
    assert path.push(IDS, {}, [], 1.0) is None
    assert path.push(np.empty(0, np.int64), {7: 3.0}, [7], 1.0) is None
    assert path.expected(np.empty(0, np.int64)) == []


def test_large_maps_and_single_keyframes() -> None:
    path = PathFilter()
    assert path.push(np.array([5]), {5: GOOD}, [5], 1.0) is not None
    assert path.push(np.array([5]), {5: GOOD}, [5], 1.0).probability < 0.95


def test_settings_move_the_threshold() -> None:
    rows = list(range(20, 30))
    strict = walk(PathFilter(PathSettings(center=5.0)), rows)[-1]
    assert strict.probability < 0.95


def test_background_follows_and_ignores_outliers() -> None:
    background = Background()
    rng = np.random.default_rng(0)
    for _ in range(400):
        background.update(float(rng.normal(0.2, 0.05)))
    mean, deviation = background.mean, background.deviation
    assert mean == pytest.approx(0.2, abs=0.02)
    assert deviation == pytest.approx(0.055, abs=0.015)
    background.update(5.0)
    assert background.mean < mean + 0.005
    assert background.z(mean + 3 * deviation) == pytest.approx(3, abs=0.4)
