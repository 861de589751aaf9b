# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Frames are accepted or skipped by their stamps."""

from hdc_place_recognition.recognition.frame_filter import FrameFilter, nanoseconds
from hdc_place_recognition.results import Status

MS = 1_000_000
START = 1_776_863_762_100_071_637


def accept(stamps: list[int], interval: int = 200 * MS) -> tuple[list[Status | None], int]:
    frames = FrameFilter()
    return [frames.accept(stamp, interval) for stamp in stamps], frames.clock_ns


def test_interval_counts_from_the_last_accepted():
    stamps = [START + ms * MS for ms in (0, 100, 199, 200, 300, 400)]
    answers, clock_ns = accept(stamps)
    soon = Status.TOO_SOON
    assert answers == [None, soon, soon, None, soon, None]
    assert clock_ns == 400 * MS


def test_one_nanosecond_decides():
    answers, _ = accept([START, START + 200 * MS - 1])
    assert answers == [None, Status.TOO_SOON]


def test_repeated_and_late_stamps_are_skipped():
    answers, clock_ns = accept([START, START, START - 500 * MS, START + 1000 * MS])
    assert answers == [None, Status.STAMP_REPEATED, Status.STAMP_OUT_OF_ORDER, None]
    assert clock_ns == 1000 * MS


def test_repeated_is_told_even_without_interval():
    answers, _ = accept([START, START], interval=0)
    assert answers == [None, Status.STAMP_REPEATED]


def test_clock_goes_on_when_stamps_are_set_back():
    day = 86_400_000 * MS
    answers, clock_ns = accept([day, day + 1000 * MS, 0, 1000 * MS])
    assert answers == [None] * 4
    assert clock_ns == 2000 * MS


def test_clock_stands_still_with_the_robot():
    frames = FrameFilter()
    for second in range(600):
        frames.accept(second * 1000 * MS, 0)
        frames.note_motion(second == 0)
    # Two seconds of rest count, as for a robot that only moves slowly.
    assert frames.clock_ns == 2000 * MS
    frames.accept(600_000 * MS, 0)
    frames.note_motion(True)
    assert frames.clock_ns == 3000 * MS


def test_clock_goes_on_with_a_slow_robot():
    frames = FrameFilter()
    for step in range(101):
        frames.accept(step * 500 * MS, 0)
        frames.note_motion(step % 4 == 0)
    assert frames.clock_ns == 50_000 * MS


def test_asking_for_the_skip_reason_changes_nothing():
    asked, accepting = FrameFilter(), FrameFilter()
    for stamp in (START, START, START + 100 * MS, START + 300 * MS, START - 10_000 * MS):
        assert asked.skip_reason(stamp, 200 * MS) == asked.skip_reason(stamp, 200 * MS)
        assert asked.skip_reason(stamp, 200 * MS) is accepting.accept(stamp, 200 * MS)
        asked.accept(stamp, 200 * MS)
        assert asked.clock_ns == accepting.clock_ns


def test_a_stamp_a_second_back_means_that_the_clock_was_set_back():
    frames = FrameFilter()
    frames.accept(START, 200 * MS)
    assert frames.skip_reason(START - 1000 * MS + 1, 200 * MS) is Status.STAMP_OUT_OF_ORDER
    assert frames.skip_reason(START - 1000 * MS, 200 * MS) is None


def test_the_next_nanosecond_is_enough_without_interval():
    frames = FrameFilter(clock_ns=7)
    assert [frames.accept(stamp, 0) for stamp in (START, START + 1)] == [None, None]
    assert frames.clock_ns == 8
    assert frames.skip_reason(START, 0) is Status.STAMP_OUT_OF_ORDER


def test_only_the_rest_beyond_two_seconds_is_taken_back():
    frames, clocks = FrameFilter(), []
    for stamp in (0, 1500, 2500, 2600, 4000):
        frames.accept(stamp * MS, 0)
        frames.note_motion(stamp in (0, 4000))
        clocks.append(frames.clock_ns // MS)
    # Of the step to 2500 half a second is taken back, of that to 2600 all of it.
    assert clocks == [0, 1500, 2000, 2000, 3400]


def test_seconds_are_rounded_to_nanoseconds():
    assert nanoseconds(0.2) == 200 * MS and nanoseconds(1.5e-9) == 2 and nanoseconds(0.0) == 0
