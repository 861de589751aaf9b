# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The output of the benchmark: a table, JSON, and plots of cost against database size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from importlib.util import find_spec
import json
from pathlib import Path
import platform
import re

from hdc_place_recognition.benchmark.timing import Measurement
import numpy as np

_PART = re.compile(r'insertion up to row (?P<row>\d+), (?P<kind>\w+)')
_SIZED = re.compile(r'(?P<what>(exact|two-stage) query, [^:]*|insertion, .*), (?P<rows>\d+) rows')
Curves = dict[str, list[tuple[int, float]]]


def table(measurements: Sequence[Measurement]) -> str:
    """Return the measurements as aligned lines."""
    rows = [('what', 'value', 'ratio', 'to', 'target')]
    rows += [
        (
            item.name,
            f'{item.value:.3g} {item.unit}'.strip(),
            '' if item.ratio is None else f'{item.ratio:.3f}',
            item.reference,
            item.target,
        )
        for item in measurements
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return '\n'.join('  '.join(map(str.ljust, row, widths)).rstrip() for row in rows)


def write(measurements: Sequence[Measurement], folder: Path) -> list[Path]:
    """
    Write benchmark.json and, if matplotlib is installed, plots; return the files written.

    benchmark.png shows costs against database size; insertion.png shows a growing database.
    """
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / 'benchmark.json'
    about = {'machine': platform.machine(), 'python': platform.python_version()}
    about['numpy'] = np.__version__
    content = {**about, 'measurements': [asdict(item) for item in measurements]}
    file.write_text(json.dumps(content, indent=2) + '\n')
    if find_spec('matplotlib') is None:
        return [file]
    files = [file]
    if curves(measurements):
        files.append(_draw_sizes(measurements, folder / 'benchmark.png'))
    if parts := insertions(measurements):
        files.append(_draw_insertions(parts, folder / 'insertion.png'))
    return files


def curves(measurements: Sequence[Measurement]) -> Curves:
    """Return the costs that depend on database size: (rows, milliseconds), ascending."""
    found: Curves = {}
    for item in measurements:
        if match := _SIZED.fullmatch(item.name):
            value = item.value / 1e3 if item.unit == 'us' else item.value
            found.setdefault(match['what'], []).append((int(match['rows']), value))
    return {name: sorted(points) for name, points in found.items()}


def insertions(measurements: Sequence[Measurement]) -> Curves:
    """Return median and maximum insertion time in a growing database: (row, microseconds)."""
    found: Curves = {}
    for item in measurements:
        if match := _PART.fullmatch(item.name):
            found.setdefault(match['kind'], []).append((int(match['row']), item.value))
    return found


def _draw_sizes(measurements: Sequence[Measurement], file: Path) -> Path:
    scales = {'xscale': 'log', 'yscale': 'log'}
    return _draw(
        curves(measurements), file, xlabel='images in the database', ylabel='ms', **scales
    )


def _draw_insertions(parts: Curves, file: Path) -> Path:
    return _draw(parts, file, xlabel='row', ylabel='us for an insertion', yscale='log')


def _draw(lines: Curves, file: Path, **axis: str) -> Path:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4.5), layout='constrained')
    axes = figure.subplots()
    for name, points in lines.items():
        axes.plot(*zip(*points, strict=True), marker='o', label=name)
    axes.set(**axis)
    axes.grid(alpha=0.3)
    figure.legend(loc='outside right upper')
    figure.savefig(file, dpi=120)
    return file
