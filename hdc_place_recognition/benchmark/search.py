# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The cost of asking a database and of adding to it, and what two stages lose."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.util import find_spec
import logging

from hdc_place_recognition.benchmark.settings import Settings
from hdc_place_recognition.benchmark.timing import (
    each_milliseconds,
    Measurement,
    milliseconds,
)
from hdc_place_recognition.benchmark.vectors import DIMENSIONS, SIDE, World
from hdc_place_recognition.database.base import Keyframe, Query
from hdc_place_recognition.database.memory import MemoryDatabase, TWO_STAGES_FROM
from hdc_place_recognition.database.vector_store import VectorStore
from hdc_place_recognition.hdc.algebra import Hypervector
from hdc_place_recognition.hdc.shifts import Shifts
import numpy as np

_log = logging.getLogger(__name__)
# Images that make the means what they are before the first row is added.
_SEEN = 50
_QUERIES = 40
_TARGETS = {10_000: '<= 0.25', 100_000: '<= 0.143'}
_RECALL_TARGETS = {10_000: ('>= 0.995', '>= 0.99'), 100_000: ('>= 0.995', '>= 0.90')}
_BEST = 10


@dataclass(frozen=True)
class _Filled:
    """A database with its rows once more, for peers, and how long each insertion took."""

    database: MemoryDatabase
    world: World
    insertions_ms: list[float]
    forms: int


def measure_search(settings: Settings) -> Iterator[Measurement]:
    """Yield what databases of some sizes cost, and peers where they are installed."""
    for peer in ('faiss', 'usearch'):
        if find_spec(peer) is None:
            _log.info('%s is not installed: skipped', peer)
    for rows in settings.sizes:
        _log.info('searching %d rows', rows)
        yield from _measure_size(rows, settings)


def _measure_size(rows: int, settings: Settings) -> Iterator[Measurement]:
    yield from _measure_one_form(_fill(rows, 1), rows, settings.bandwidth)
    filled = _fill(rows, SIDE * SIDE)
    yield from _measure_stages(filled, rows, settings.products)
    if rows >= TWO_STAGES_FROM:
        half = _fill(rows, SIDE * SIDE, 'float16')
        name = 'two-stage query, half floats'
        yield from _measure_recall(filled.database, half.database, filled.world, name)


def _measure_one_form(single: _Filled, rows: int, bandwidth: float) -> Iterator[Measurement]:
    query = np.ascontiguousarray(single.world.query(0)[SIDE * SIDE // 2][None])
    asked = Query(0, query)
    limit = rows * 4 * DIMENSIONS / bandwidth
    spent = milliseconds(lambda: single.database.search(asked, _BEST, exact=True))
    name = f'exact query, 1 form, {rows} rows'
    yield Measurement(name, spent, 'ms', spent / limit, 'bandwidth', '<= 1.15')
    if rows >= TWO_STAGES_FROM:
        fast = milliseconds(lambda: single.database.search(asked, _BEST))
        name = f'two-stage query, 1 form, {rows} rows'
        yield Measurement(name, fast, 'ms', fast / spent, 'exact')
    yield from _measure_peers(single, rows, query, spent)
    yield from _measure_insertion(single, rows)


def _fill(rows: int, forms: int, row_type: str = 'float32') -> _Filled:
    groups = Shifts(SIDE, SIDE, 0.1).groups if forms > 1 else ()
    database = MemoryDatabase(VectorStore(DIMENSIONS, row_type), forms, True, groups)
    world = World(rows)
    middle = slice(None) if forms > 1 else slice(SIDE * SIDE // 2, SIDE * SIDE // 2 + 1)
    for number in range(_SEEN):
        database.update_mean(Query(0, world.query(number)[middle]))
    insertions = []
    for number in range(rows):
        keyframe = Keyframe(0, 0, world.row(number))
        insertions += each_milliseconds(partial(database.add, keyframe), 1)
    return _Filled(database, world, insertions, forms)


def _measure_insertion(filled: _Filled, rows: int) -> Iterator[Measurement]:
    spent = np.array(filled.insertions_ms) * 1e3
    yield Measurement(f'insertion, median, {rows} rows', float(np.median(spent)), 'us')
    yield Measurement(f'insertion, maximum, {rows} rows', float(spent.max()), 'us')
    kilobytes = filled.database.nbytes / rows / 1e3
    yield Measurement(f'memory of a row, {rows} rows', kilobytes, 'kB')


def _measure_stages(filled: _Filled, rows: int, peak: float) -> Iterator[Measurement]:
    """Yield the exact query, a row of the similarity matrix, and the one in two stages."""
    database, forms = filled.database, filled.forms
    query = Query(0, filled.world.query(0))
    exact = milliseconds(lambda: database.search(query, _BEST, exact=True))
    name = f'exact query, {forms} forms, {rows} rows'
    rate = rows * (forms + 1) * DIMENSIONS / exact  # with all forms, and with the mean
    yield Measurement(name, exact, 'ms', rate / peak, 'products', '>= 0.6')
    if rows < TWO_STAGES_FROM:
        return
    name = f'two-stage query, {forms} forms'
    yield from _measure_recall(database, database, filled.world, name, _TARGETS.get(rows, ''))


def _measure_recall(
    exact: MemoryDatabase, fast: MemoryDatabase, world: World, name: str, target: str = ''
) -> Iterator[Measurement]:
    """Yield what two stages cost and find, against all rows compared exactly."""
    rows, query = len(fast), Query(0, world.query(0))
    whole = milliseconds(lambda: exact.search(query, _BEST, exact=True))
    spent = milliseconds(lambda: fast.search(query, _BEST))
    yield Measurement(f'{name}, {rows} rows', spent, 'ms', spent / whole, 'exact', target)
    queries = [Query(0, world.query(number)) for number in range(_SEEN, _SEEN + _QUERIES)]
    recalls = np.mean([_recalls(exact, fast, query) for query in queries], axis=0).tolist()
    targets = _RECALL_TARGETS.get(rows, ('', ''))
    for best, recall, least in zip((1, _BEST), recalls, targets, strict=True):
        label = f'{name}: recall@{best}, {rows} rows'
        yield Measurement(label, recall, '', recall, 'exact', least)


def _recalls(exact: MemoryDatabase, fast: MemoryDatabase, query: Query) -> tuple[float, float]:
    """Return which share of the best row, and of the best ten, two stages find."""
    results = exact.search(query, _BEST, exact=True), fast.search(query, _BEST)
    rows = [result.similarities for result in results]
    true, found = (np.argsort(-row, kind='stable')[:_BEST] for row in rows if row is not None)
    return float(true[0] == found[0]), float(np.isin(true, found).mean())


def _measure_peers(
    filled: _Filled, rows: int, query: Hypervector, exact: float
) -> Iterator[Measurement]:
    """Yield the exact search of other libraries, where they are installed."""
    if find_spec('faiss') is None and find_spec('usearch') is None:
        return
    vectors = np.stack([filled.world.row(number) for number in range(rows)])
    if find_spec('faiss') is not None:
        # It tells of each variant of itself that it tries to load.
        logging.getLogger('faiss').setLevel(logging.WARNING)
        index = import_module('faiss').IndexFlatIP(DIMENSIONS)
        index.add(vectors)
        spent = milliseconds(lambda: index.search(query, _BEST))
        yield Measurement(f'faiss IndexFlatIP, {rows} rows', spent, 'ms', spent / exact, 'exact')
    if find_spec('usearch') is not None:
        search = import_module('usearch.index').search
        spent = milliseconds(lambda: search(vectors, query[0], _BEST, 'ip', exact=True))
        yield Measurement(f'usearch exact, {rows} rows', spent, 'ms', spent / exact, 'exact')
