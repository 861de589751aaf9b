# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The runs of `hdc_experiments trust`: datasets as they are, and what makes them harder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hdc_place_recognition.datasets.arrays import ArrayImages
from hdc_place_recognition.datasets.dataset import Dataset, Frames, Mode, Stamps
from hdc_place_recognition.datasets.folders import FolderImages
from hdc_place_recognition.datasets.open_dataset import open_dataset
from hdc_place_recognition.datasets.variants import (
    AloneTruth,
    First,
    NothingInCommon,
    Reversed,
    ReversedTruth,
    Rolled,
    Shifted,
    SwappedTruth,
    Thinned,
    Zoomed,
)
from hdc_place_recognition.experiments.runs import load_into_memory
from hdc_place_recognition.recognition.frame_filter import nanoseconds
import numpy as np

# Minimum age of candidates in seconds when a traverse is evaluated alone.
_TRAVERSE_GAP_S = 10.0
# With --against the queries are every second image, compared with the sets that come so many
# places later on the command line.
_AGAINST_STEP, _AGAINST = 2, (1, 2)


@dataclass(frozen=True)
class Choices:
    """
    Which variants of a dataset are evaluated, besides the plain one and each traverse alone.

    :param rolls: ranges of angles in degrees.
    :param seeds: number of runs with different random angles.
    :param zooms: scales.
    :param shift: whether images are shifted by a third.
    :param thin: every n-th image only.
    :param reverse: whether sequences, or the queries of two traverses, are reversed.
    :param swap: whether map and queries of two traverses are exchanged.
    :param against: whether sets are compared with each other.
    :param queries: largest number of queries of two traverses, 0 for all.
    """

    rolls: Sequence[tuple[float, float]] = ()
    seeds: int = 3
    zooms: Sequence[float] = ()
    shift: bool = False
    thin: Sequence[int] = ()
    reverse: bool = False
    swap: bool = False
    against: bool = False
    queries: int = 0


ALL = Choices(
    rolls=((15.0, 30.0), (30.0, 45.0)),
    zooms=(1.5, 0.6),
    shift=True,
    thin=(2, 4),
    reverse=True,
    swap=True,
    against=True,
)


@dataclass(frozen=True)
class Run:
    """
    One run of the recognizer.

    :param folder: name of the set.
    :param variant: what is different, empty for the plain set.
    :param dataset: images and ground truth.
    :param seed: of random angles, None if there are none.
    :param same_start: whether the images before the first revisit are those of the plain set.
    """

    folder: str
    variant: str
    dataset: Dataset
    seed: int | None = None
    same_start: bool = False

    @property
    def name(self) -> str:
        """Return the name of the run in tables."""
        seed = '' if self.seed is None else f' (seed {self.seed})'
        return f'{self.folder}, {self.variant}{seed}' if self.variant else self.folder


def runs_of(path: Path, choices: Choices) -> Iterator[Run]:
    """
    Yield the runs on one set: plain, each traverse alone, and the variants that are chosen.

    :raises PlaceRecognitionError: an input is invalid.
    """
    opened = _open(path)
    dataset = _limited(opened, choices.queries)
    yield Run(dataset.name, '', dataset)
    yield from _alone(opened, choices.queries)
    yield from _image_variants(dataset, choices)
    if dataset.mode is not Mode.RETRIEVAL:
        yield from (_thinned(dataset, step) for step in choices.thin)
        if choices.reverse:
            yield _reversed(dataset)
    if choices.swap and opened.reference is not None:
        yield _swapped(opened, opened.reference, choices.queries)


def runs_against(paths: Sequence[Path], choices: Choices) -> Iterator[Run]:
    """Yield runs with the queries of one set and the map of another: every closure is false."""
    count = len(paths)
    for step in _AGAINST[: count - 1] if choices.against else ():
        for index, path in enumerate(paths):
            queries, target = open_dataset(path), open_dataset(paths[(index + step) % count])
            yield Run(
                queries.name,
                f'against {target.name}',
                Dataset(
                    f'{queries.name} against {target.name}',
                    Mode.TRAVERSES,
                    Thinned(_limited(queries, choices.queries).queries, _AGAINST_STEP),
                    target.queries if target.reference is None else target.reference,
                    NothingInCommon(),
                    {**queries.overrides, **target.overrides},
                ),
            )


def revisits(dataset: Dataset) -> frozenset[int]:
    """Return the positions of the queries that have a hard or soft match to be found."""
    truth, stamps_ns = dataset.ground_truth, _stamps(dataset.queries)
    if truth is None:
        return frozenset()
    if dataset.reference is None:
        pairs = truth.truth(stamps_ns, stamps_ns)
        gap_ns = nanoseconds(float(dataset.overrides.get('exclude_recent_s', 0.0)))
        eligible = stamps_ns[:, None] - stamps_ns >= max(gap_ns, 1)
    else:
        pairs = truth.truth(stamps_ns, _stamps(dataset.reference))
        eligible = np.ones_like(pairs.hard)
    return frozenset(np.flatnonzero(((pairs.hard | pairs.soft) & eligible).any(axis=1)).tolist())


def _open(path: Path) -> Dataset:
    """Open a set with its images in memory; without ground truth every closure is false."""
    dataset = load_into_memory(open_dataset(path))
    return replace(dataset, ground_truth=dataset.ground_truth or NothingInCommon())


def _limited(dataset: Dataset, count: int) -> Dataset:
    """Return two traverses with at most `count` queries, 0 for all."""
    if not count or dataset.reference is None:
        return dataset
    return replace(dataset, queries=First(dataset.queries, count))


def _alone(dataset: Dataset, count: int) -> Iterator[Run]:
    """Yield each of two traverses as a sequence, in which nothing is revisited."""
    if dataset.reference is None or dataset.ground_truth is None:
        return
    truth = dataset.ground_truth
    parts = (
        ('reference', dataset.reference, AloneTruth(truth, _stamps(dataset.queries))),
        ('query', dataset.queries, AloneTruth(SwappedTruth(truth), _stamps(dataset.reference))),
    )
    for part, frames, nothing in parts:
        yield Run(
            dataset.name,
            f'{part} alone',
            replace(
                dataset,
                mode=Mode.SEQUENCE,
                queries=First(frames, count) if count else frames,
                reference=None,
                ground_truth=nothing,
                overrides={**dataset.overrides, 'exclude_recent_s': _TRAVERSE_GAP_S},
            ),
        )


def _image_variants(dataset: Dataset, choices: Choices) -> Iterator[Run]:
    """Yield the set with rolled, zoomed and shifted revisits; the map is not changed."""
    if dataset.mode is Mode.RETRIEVAL:
        return
    frames, changed = dataset.queries, revisits(dataset)
    for low, high in choices.rolls:
        for seed in range(choices.seeds):
            rolled = Rolled(frames, low, high, seed, changed)
            yield _variant(dataset, f'rolled {low:g} to {high:g}', rolled, seed)
    for factor in choices.zooms:
        yield _variant(dataset, f'zoomed {factor:g}', Zoomed(frames, factor, changed))
    if choices.shift:
        yield _variant(dataset, 'shifted', Shifted(frames, changed))


def _variant(dataset: Dataset, variant: str, queries: Frames, seed: int | None = None) -> Run:
    changed = replace(dataset, queries=queries)
    return Run(dataset.name, variant, changed, seed, same_start=True)


def _thinned(dataset: Dataset, step: int) -> Run:
    reference = None if dataset.reference is None else Thinned(dataset.reference, step)
    thinned = replace(dataset, queries=Thinned(dataset.queries, step), reference=reference)
    return Run(dataset.name, f'every {step}', thinned)


def _reversed(dataset: Dataset) -> Run:
    stamps_ns, truth = _stamps(dataset.queries), dataset.ground_truth
    mirror_ns = int(stamps_ns[0] + stamps_ns[-1])
    return Run(
        dataset.name,
        'backwards',
        replace(
            dataset,
            queries=Reversed(dataset.queries, mirror_ns),
            ground_truth=truth and ReversedTruth(truth, mirror_ns, dataset.reference is None),
        ),
    )


def _swapped(dataset: Dataset, reference: Frames, count: int) -> Run:
    swapped = replace(
        dataset,
        queries=reference,
        reference=dataset.queries,
        ground_truth=dataset.ground_truth and SwappedTruth(dataset.ground_truth),
    )
    return Run(dataset.name, 'swapped', _limited(swapped, count))


def _stamps(frames: Frames) -> Stamps:
    """Return the stamps of all images in nanoseconds."""
    if isinstance(frames, FolderImages | ArrayImages):
        return frames.stamps_ns
    return np.array([frame.stamp_ns for frame in frames], np.int64)
