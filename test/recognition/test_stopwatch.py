# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Stages are timed in milliseconds, which add up."""

from hdc_place_recognition.recognition import stopwatch
from hdc_place_recognition.recognition.stopwatch import Stopwatch
import pytest


def test_milliseconds_of_a_stage_add_up(monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = iter([1.0, 1.25, 2.0, 2.5, 4.0, 5.0])
    monkeypatch.setattr(stopwatch, 'perf_counter', lambda: next(seconds))
    earlier = {'query': 3.0}
    watch = Stopwatch(earlier)
    for name in ('encode', 'query', 'encode'):
        with watch.stage(name):
            pass
    assert watch.milliseconds == {'encode': 1250.0, 'query': 503.0}
    assert earlier == {'query': 3.0}
