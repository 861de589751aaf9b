# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The parts of the benchmark, in the order in which they are measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

from hdc_place_recognition.benchmark.encoding import measure_encoding
from hdc_place_recognition.benchmark.images import measure_extraction, measure_pipeline
from hdc_place_recognition.benchmark.memory import measure_memory, measure_million
from hdc_place_recognition.benchmark.node import measure_node
from hdc_place_recognition.benchmark.search import measure_search
from hdc_place_recognition.benchmark.settings import Settings
from hdc_place_recognition.benchmark.timing import Measurement

PARTS: Mapping[str, Callable[[Settings], Iterator[Measurement]]] = MappingProxyType(
    {
        'encoding': measure_encoding,
        'search': measure_search,
        'extraction': measure_extraction,
        'pipeline': measure_pipeline,
        'node': measure_node,
        'memory': measure_memory,
        'million': measure_million,
    }
)
# What takes minutes or gigabytes is measured only if it is asked for.
LARGE_PARTS = frozenset({'memory', 'million'})
