# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""How long each stage takes; measured, and never decided by."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from time import perf_counter


class Stopwatch:
    """
    Adds up the milliseconds of named stages.

    :param so_far: milliseconds of earlier stages.
    """

    def __init__(self, so_far: Mapping[str, float] | None = None) -> None:
        self.milliseconds = dict(so_far or {})

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time spent inside to a stage."""
        start = perf_counter()
        yield
        spent = (perf_counter() - start) * 1000
        self.milliseconds[name] = self.milliseconds.get(name, 0.0) + spent
