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
    for stamp in (0, 900, 1800, 2700, 2800, 4200):
        frames.accept(stamp * MS, 0)
        frames.note_motion(stamp in (0, 4200))
        clocks.append(frames.clock_ns // MS)
    # Of the step to 2700, 0.7 s are taken back, of that to 2800 all of it.
    assert clocks == [0, 900, 1800, 2000, 2000, 3400]


def test_seconds_are_rounded_to_nanoseconds():
    assert nanoseconds(0.2) == 200 * MS and nanoseconds(1.5e-9) == 2 and nanoseconds(0.0) == 0


def sessions(stamps: list[int]) -> list[int]:
    """Return the number of the session of each accepted stamp."""
    frames, number, found = FrameFilter(), 0, []
    for stamp in stamps:
        if frames.skip_reason(stamp, 0) is None:
            number += frames.begins_session(stamp)
            found.append(number)
        frames.accept(stamp, 0)
    return found


def jumping(count: int, jump: int, run: int, step: int = 250 * MS) -> list[int]:
    """Return stamps that jump ahead and back, each time for so many frames."""
    return [START + i * step + jump * (i // run % 2) for i in range(count)]


def test_clock_set_back_begins_a_session():
    stamps = [10_000, 10_250, 9_900, 0, 250, 1_500, 0]
    assert sessions([stamp * MS for stamp in stamps]) == [0, 0, 1, 1, 1, 2]


def test_one_stamp_in_the_future_ages_nothing_and_begins_no_session():
    year = 365 * 86_400_000 * MS
    stamps = [START + i * 250 * MS for i in range(40)]
    stamps[20] += year
    assert sessions(stamps) == [0] * 40
    _, clock_ns = accept(stamps, 0)
    assert clock_ns == 39 * 250 * MS


def test_a_step_of_the_clock_counts_as_a_few_usual_steps():
    decades = 50 * 365 * 86_400_000 * MS
    stamps = [i * 500 * MS + (decades if i > 9 else 0) for i in range(20)]
    answers, clock_ns = accept(stamps, 0)
    assert answers == [None] * 20
    assert clock_ns == 18 * 500 * MS + 2 * 500 * MS


def test_stamps_that_jump_ahead_and_back_do_not_age_the_database():
    for jump, run in ((4400 * MS, 4), (4400 * MS, 1), (60_000 * MS, 3), (1500 * MS, 10)):
        _, clock_ns = accept(jumping(400, jump, run), 0)
        # 100 s have passed; the stamps jump ahead by up to 1000 s.
        assert 90_000 * MS < clock_ns <= 150_000 * MS


def test_a_clock_that_steps_ahead_every_second_ages_little():
    _, clock_ns = accept([i * 250 * MS + i // 4 * 5000 * MS for i in range(400)], 0)
    assert clock_ns < 1.8 * 100_000 * MS


def test_no_stamp_occurs_twice_in_a_session():
    # The stamps reach again and again what a jump has used before.
    for jump, run in ((4500 * MS, 4), (1500 * MS, 1), (10_000 * MS, 10), (250 * MS, 5)):
        stamps, frames, used = jumping(400, jump, run), FrameFilter(), set()
        for stamp in stamps:
            if frames.skip_reason(stamp, 0) is None and frames.begins_session(stamp):
                used.clear()
            if frames.accept(stamp, 0) is None:
                assert stamp not in used
                used.add(stamp)


def test_a_gap_of_slow_frames_is_no_jump():
    minute = 60_000 * MS
    _, clock_ns = accept([0, *(minute * i for i in (1, 2, 3, 5, 6))], 0)
    # Only the first step is not known to be usual.
    assert clock_ns == 5 * minute + 1000 * MS


def test_frames_without_stamps_go_by_arrival():
    answers, clock_ns = accept([0] * 51)
    assert answers == [None] * 51
    assert clock_ns == 5_000 * MS
    assert sessions([0] * 51) == [0] * 51


def test_a_simulation_that_starts_at_0_has_stamps():
    answers, _ = accept([0, 100 * MS, 200 * MS])
    assert answers == [None, Status.TOO_SOON, None]
