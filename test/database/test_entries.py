# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows that come and go, compared with a list of keyframes."""

from __future__ import annotations

from hdc_place_recognition.database.base import Keyframe
from hdc_place_recognition.database.entries import Entries, NO_WORDS
from hdc_place_recognition.features.cells import Cells
from hdc_place_recognition.features.compact import CompactKeypoints
import numpy as np
import pytest

Row = tuple[int, Keyframe]


def keyframe(rng: np.random.Generator, clock_ns: int) -> Keyframe:
    """Return a keyframe of one of three traverses, with keypoints and cells or without."""
    count = int(rng.integers(1, 9))
    keypoints = CompactKeypoints(
        np.zeros((count, 2), np.uint16),
        *(np.zeros(count, np.uint8),) * 2,
        np.zeros((count, 4), np.uint8),
        1.0,
    )
    cells = Cells(np.zeros((count, 2), np.uint8), np.zeros(2, np.uint8), 1, count, 8)
    return Keyframe(
        clock_ns + 7,
        clock_ns,
        np.zeros(4, np.float32),
        keypoints=keypoints if rng.random() < 0.5 else None,
        cells=cells if rng.random() < 0.5 else None,
        traverse=int(rng.integers(0, 3)),
    )


def of_traverse(rows: list[Row], keyframe_id: int) -> list[int]:
    """Return the ids of the traverse of a keyframe; none if it is unknown."""
    traverses = [found.traverse for number, found in rows if number == keyframe_id]
    return [number for number, found in rows if found.traverse in traverses]


def check(entries: Entries, rows: list[Row], rng: np.random.Generator) -> None:
    ids = [number for number, _ in rows]
    assert [*entries.ids] == ids and len(entries) == len(rows)
    held = [part for _, found in rows for part in (found.keypoints, found.cells)]
    objects = sum(part.nbytes for part in held if part is not None)
    assert entries.nbytes == 60 * len(rows) + objects
    for row, (number, found) in enumerate(rows):
        assert entries.row(number) == row
        assert entries.keypoints[row] is found.keypoints and entries.cells[row] is found.cells
        assert entries.oldest(row) == (number in of_traverse(rows, number)[:2])
    first, second = (int(number) for number in rng.integers(0, ids[-1] + 3, 2))
    same = of_traverse(rows, first)
    known = first in same and second in same
    expected = abs(same.index(first) - same.index(second)) if known else None
    assert entries.distance(first, second) == expected
    radius, place = int(rng.integers(0, 5)), same.index(first) if first in same else 0
    assert entries.near(first, radius) == tuple(
        number for n, number in enumerate(same) if 1 <= abs(n - place) <= radius
    )
    clock_ns, traverse = int(rng.integers(-1, 400)), int(rng.integers(0, 4))
    assert entries.count_until(clock_ns) == sum(found.clock_ns <= clock_ns for _, found in rows)
    assert entries.other_visits(traverse, clock_ns).tolist() == [
        number
        for number, found in rows
        if found.traverse != traverse or found.clock_ns <= clock_ns
    ]
    start, end = sorted(rng.integers(0, len(rows) + 1, 2).tolist())
    assert entries.rows_of(traverse, start, end).tolist() == [
        row for row in range(start, end) if rows[row][1].traverse == traverse
    ]


@pytest.mark.parametrize('seed', range(2))
def test_rows_come_and_go(seed):
    rng, entries, rows = np.random.default_rng(seed), Entries(), []
    for number in range(200):
        added = keyframe(rng, 2 * number)
        entries.add(number, added, NO_WORDS)
        rows.append((number, added))
        while len(rows) > 1 and rng.random() < 0.45:
            row = int(rng.integers(len(rows)))
            entries.remove(row)
            del rows[row]
        check(entries, rows, rng)


def test_rows_near_are_those_of_the_traverse():
    entries = Entries()
    for number in range(9):
        entries.add(
            10 * number, Keyframe(0, number, np.zeros(4, np.float32), traverse=number % 2), 5
        )
    entries.remove(4)
    # Of traverse 0 the ids 0, 20, 60, 80 are left, in the rows 0, 2, 5 and 7.
    assert entries.rows_near(2, 1) == [0, 5] and entries.rows_near(5, 2) == [0, 2, 7]
    assert [*entries.word_slots] == [5] * 8
