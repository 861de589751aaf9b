# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Fills a database in a process of its own, so that the memory it takes can be told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
import json
import os
from pathlib import Path
import subprocess
import sys
from time import perf_counter

from hdc_place_recognition.benchmark.vectors import DIMENSIONS, LargeWorld, SIDE
from hdc_place_recognition.database.base import Keyframe, Query
from hdc_place_recognition.database.eviction import Capacity
from hdc_place_recognition.database.memory import MemoryDatabase
from hdc_place_recognition.database.storage import FileStorage
from hdc_place_recognition.database.vector_store import VectorStore
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.compact import CompactKeypoints
from hdc_place_recognition.hdc.shifts import Shifts
from hdc_place_recognition.hdc.words import KEYPOINTS, TABLES, WORDS
import numpy as np
from numpy.typing import NDArray

PARTS = 10
_LEAST_POINTS, _MOST_POINTS = 100, 300
_WARM = 2
# Words of a query are not those of a keyframe: the vectors decide.
_QUERY_SEEDS = 10**9


@dataclass(frozen=True)
class FillTask:
    """
    What is to be done.

    :param images: that are added.
    :param landmarks: whether each has some.
    :param folder: of the vectors; empty for memory.
    :param queries: that are asked in the end.
    """

    images: int
    landmarks: bool = False
    max_keyframes: int = 0
    max_megabytes: float = 0.0
    row_type: str = 'float32'
    folder: str = ''
    queries: int = 0


@dataclass(frozen=True)
class FillResult:
    """
    What came of it.

    :param medians_us: of the insertions in each of so many equal parts.
    :param maxima_us: of the same.
    :param taken_by: bytes of resident memory more than before, after each part.
    :param promised: bytes that the database says it takes.
    :param most_promised: the most it said at any time.
    :param resident: bytes of the whole process in the end.
    :param peak: bytes of the whole process at most.
    :param queries_ms: what each took.
    :param found: share of queries whose best row is of the right place.
    """

    medians_us: list[float]
    maxima_us: list[float]
    taken_by: list[int]
    promised: int
    most_promised: int
    images: int
    forgotten: int
    resident: int
    peak: int
    queries_ms: list[float]
    found: float


def fill_alone(filling: FillTask) -> FillResult:
    """
    Fill a database in another process.

    :raises PlaceRecognitionError: it failed.
    """
    words = [sys.executable, '-m', __spec__.name, json.dumps(asdict(filling))]
    environment = {**os.environ, 'OPENBLAS_NUM_THREADS': '1'}
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1:] or [f'exit code {done.returncode}']
        raise PlaceRecognitionError(f'database of {filling.images} images: {last[0]}')
    return FillResult(**json.loads(done.stdout))


def fill(filling: FillTask) -> FillResult:
    """Fill a database, and ask it."""
    world = LargeWorld(filling.images)
    database = _database(filling)
    for number in range(_WARM):
        database.update_mean(Query(number, world.query(number)))
    before, most_promised = _resident(), 0
    spent = np.empty(filling.images, np.float32)
    taken_by: list[int] = []
    for number in range(filling.images):
        keypoints = _keypoints(number) if filling.landmarks else None
        words = random_words(number) if filling.landmarks else None
        # The most similar keyframe before it, which a real robot knows from its search.
        twin = number - 1 if number else None
        keyframe = Keyframe(number, number, world.row(number), keypoints, words, twin=twin)
        start = perf_counter()
        database.add(keyframe)
        spent[number] = (perf_counter() - start) * 1e6
        most_promised = max(most_promised, database.nbytes)
        if (number + 1) * PARTS // filling.images > len(taken_by):
            taken_by.append(_resident() - before)
    parts = np.array_split(spent, PARTS)
    queries_ms, found = _ask(database, world, filling.queries)
    return FillResult(
        medians_us=[float(np.median(part)) for part in parts],
        maxima_us=[float(part.max()) for part in parts],
        taken_by=taken_by,
        promised=database.nbytes,
        most_promised=most_promised,
        images=len(database),
        forgotten=database.evicted_count,
        resident=_resident(),
        peak=_peak(),
        queries_ms=queries_ms,
        found=found,
    )


def _database(filling: FillTask) -> MemoryDatabase:
    storage = FileStorage(Path(filling.folder)) if filling.folder else None
    return MemoryDatabase(
        VectorStore(DIMENSIONS, filling.row_type, storage),
        SIDE * SIDE,
        True,
        Shifts(SIDE, SIDE, 0.1).groups,
        Capacity(filling.max_keyframes, filling.max_megabytes),
    )


def _ask(database: MemoryDatabase, world: LargeWorld, queries: int) -> tuple[list[float], float]:
    """Return what queries take, and which share of them is answered rightly."""
    spent, right = [], 0
    for number in range(queries + _WARM):
        query = Query(number, world.query(number), words=random_words(_QUERY_SEEDS + number))
        start = perf_counter()
        best = database.search(query, 1).matches[0]
        spent.append((perf_counter() - start) * 1e3)
        right += number >= _WARM and world.shows(number, best.keyframe_id)
    return spent[_WARM:], right / max(queries, 1)


def _keypoints(number: int) -> CompactKeypoints:
    """Return keypoints that take as much memory as those of an image."""
    count = _LEAST_POINTS + number * 7919 % (_MOST_POINTS - _LEAST_POINTS + 1)
    ones: NDArray[np.uint8] = np.ones((count, 66), np.uint8)
    positions = np.ones((count, 2), np.uint16)
    return CompactKeypoints(
        positions, ones[:, 0].copy(), ones[:, 1].copy(), ones[:, 2:].copy(), aspect=0.75
    )


def random_words(seed: int) -> NDArray[np.int32]:
    """Return as many words as an image has, which few other images share."""
    words = np.random.default_rng(seed).integers(WORDS, size=KEYPOINTS * TABLES)
    return np.unique(words).astype(np.int32)


def _resident() -> int:
    pages = Path('/proc/self/statm').read_text().split()[1]
    return int(pages) * os.sysconf('SC_PAGE_SIZE')


def _peak() -> int:
    status = Path('/proc/self/status').read_text()
    return int(status.split('VmHWM:')[1].split()[0]) << 10


def main(argv: Sequence[str]) -> int:
    """Do what the first argument says, in JSON, and print what came of it."""
    print(json.dumps(asdict(fill(FillTask(**json.loads(argv[0]))))))
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
