# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Number of inputs of the fuzz tests, and a table of what they cost.

HDC_FUZZ_EXAMPLES=100000 pytest test/fuzz -k poses_csv    is a longer run of a target
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import os
import resource
import sys
from time import perf_counter
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
import pytest

# `colcon test` runs with the packages of the robot.
hypothesis = pytest.importorskip('hypothesis')
EXAMPLES = int(os.environ.get('HDC_FUZZ_EXAMPLES', '0'))
_SLOWEST_S = 2.0

hypothesis.settings.register_profile(
    'fuzz',
    deadline=None,
    derandomize=not EXAMPLES,
    database=None,
    max_examples=EXAMPLES or 40,
    suppress_health_check=list(hypothesis.HealthCheck),
)
hypothesis.settings.load_profile('fuzz')


@dataclass
class Target:
    """
    Calls a function with inputs; only a result or the error for users may come out.

    :param inputs: number of inputs so far.
    :param refused: how many of them raised PlaceRecognitionError.
    :param slowest_s: longest time of an input.
    """

    inputs: int = 0
    refused: int = 0
    slowest_s: float = 0.0

    def __call__(self, function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """Return the result of the function, None if it raised the error for users."""
        self.inputs += 1
        start = perf_counter()
        try:
            return function(*arguments, **options)
        except PlaceRecognitionError as error:
            self.refused += 1
            assert '\n' not in str(error)
        finally:
            took = perf_counter() - start
            self.slowest_s = max(self.slowest_s, took)
            assert took < _SLOWEST_S


@pytest.fixture(name='target')
def target_fixture(request: pytest.FixtureRequest) -> Iterator[Target]:
    """Count the inputs of a test; a longer run prints them, with the peak of the memory so far."""
    counted = Target()
    yield counted
    if EXAMPLES:
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        with request.config.pluginmanager.getplugin(
            'capturemanager'
        ).global_and_fixture_disabled():
            sys.stdout.write(
                f'\n| {request.node.name} | {counted.inputs} inputs | {counted.refused} refused '
                f'| {1000 * counted.slowest_s:.0f} ms | {peak_mb:.0f} MB |\n'
            )
