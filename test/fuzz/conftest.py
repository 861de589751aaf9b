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
from time import perf_counter
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
from hypothesis import HealthCheck, settings
import pytest

EXAMPLES = int(os.environ.get('HDC_FUZZ_EXAMPLES', '0'))
_SLOWEST_S = 2.0
_REPORTS: list[str] = []

settings.register_profile(
    'fuzz',
    deadline=None,
    derandomize=not EXAMPLES,
    database=None,
    max_examples=EXAMPLES or 40,
    suppress_health_check=list(HealthCheck),
)
settings.load_profile('fuzz')


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


@pytest.fixture
def target(request: pytest.FixtureRequest) -> Iterator[Target]:
    """Count the inputs of a test; the memory is the largest of the process so far."""
    counted = Target()
    yield counted
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    _REPORTS.append(
        f'| {request.node.name} | {counted.inputs} | {counted.refused} '
        f'| {1000 * counted.slowest_s:.0f} ms | {peak_mb:.0f} MB |'
    )


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print the table of a longer run."""
    if EXAMPLES and _REPORTS:
        terminalreporter.write_line('| target | inputs | refused | slowest | peak memory |')
        for line in _REPORTS:
            terminalreporter.write_line(line)
