# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Images and their local features, kept while many settings look at the same ones."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
import hashlib
from itertools import product
import logging
from time import perf_counter

from hdc_place_recognition.datasets.dataset import Dataset, Frame, Frames
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.evaluate import evaluate
from hdc_place_recognition.features.local_features import Extractor, LocalFeatures
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.params.table import Params, Value
from hdc_place_recognition.recognition.factory import assemble
import numpy as np
from numpy.typing import NDArray
import threadpoolctl

LIMIT_BYTES = 2**30  # of images, and as much again of features


class KeepingExtractor:
    """
    An extractor that looks at each image once.

    What does not fit any more is extracted every time: images are gone through in order, so that
    dropping the oldest would lose each just before it is needed.

    :param extractor: the real one.
    :param limit_bytes: of features kept.
    """

    def __init__(self, extractor: Extractor, limit_bytes: int = LIMIT_BYTES) -> None:
        self._extractor = extractor
        self._free_bytes = limit_bytes
        self._kept: dict[tuple[tuple[int, ...], bytes], LocalFeatures] = {}

    @property
    def identity(self) -> str:
        """Return the real extractor's: the features are its own."""
        return self._extractor.identity

    def extract(self, image: NDArray[np.uint8]) -> LocalFeatures:
        """Return the features of an image, known by its content."""
        key = image.shape, hashlib.sha1(np.ascontiguousarray(image).data).digest()
        found = self._kept.get(key)
        if found is None:
            found = self._extractor.extract(image)
            self._keep(key, found)
        return found

    def _keep(self, key: tuple[tuple[int, ...], bytes], features: LocalFeatures) -> None:
        arrays = (features.keypoints, features.descriptors, features.pooled)
        size = sum(array.nbytes for array in arrays if array is not None)
        if size <= self._free_bytes:
            self._free_bytes -= size
            self._kept[key] = features


def in_memory(dataset: Dataset) -> Dataset:
    """Return the same data set with its images decoded once, if they fit."""
    return replace(
        dataset,
        queries=_decoded(dataset.queries),
        reference=None if dataset.reference is None else _decoded(dataset.reference),
    )


def _decoded(frames: Frames, limit_bytes: int = LIMIT_BYTES) -> Frames:
    kept: list[Frame] = []
    for stamp_ns, image in frames:
        limit_bytes -= image.nbytes
        if limit_bytes < 0:
            return frames
        kept.append((stamp_ns, image))
    return kept


_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Variant:
    """
    One setting of the vector.

    :param name: short, for tables.
    :param changes: parameters that differ from the default.
    :param verdict: on what the name says: kept (as an option), dropped, or it is the default.
    :param why: the reason in a few words.
    """

    name: str
    changes: Mapping[str, Value]
    verdict: str
    why: str


@dataclass(frozen=True)
class Plan:
    """
    What is to be run.

    :param datasets: with ground truth and different names.
    :param variants: of the vector.
    :param seeds: of the random vectors.
    :param base: parameters that the variants change.
    """

    datasets: Sequence[Dataset]
    variants: Sequence[Variant]
    seeds: Sequence[int]
    base: Params

    @property
    def count(self) -> int:
        """Return how many runs there are."""
        return len(self.datasets) * len(self.variants) * len(self.seeds)


@dataclass(frozen=True)
class Run:
    """
    What one variant reached on one data set with one seed.

    :param average_precision: over all pairs.
    :param recall_at_1: share of queries whose best match is right.
    :param seconds: the run took, extraction left out but for the first run of its kind.
    """

    dataset: str
    variant: str
    seed: int
    average_precision: float
    recall_at_1: float
    seconds: float


def measure(plan: Plan) -> Iterator[Run]:
    """
    Yield the runs of a plan, data set by data set; the features of an image are extracted once.

    :raises PlaceRecognitionError: an image can not be read, or there is nothing to be found.
    """
    with threadpoolctl.threadpool_limits(plan.base.threads, user_api='blas'):
        for dataset in map(in_memory, plan.datasets):
            _log.info(
                '%s: %d variants, %d seeds', dataset.name, len(plan.variants), len(plan.seeds)
            )
            base = plan.base.replace(**dataset.overrides)
            for extractor, variants in _by_extractor(plan.variants, base):
                for variant, seed in product(variants, plan.seeds):
                    params = base.replace(**variant.changes, seed=seed)
                    yield _run(dataset, variant.name, params, extractor)


def _run(dataset: Dataset, variant: str, params: Params, extractor: Extractor) -> Run:
    start = perf_counter()
    judgement = evaluate(dataset, assemble(params, extractor)).judgement
    ranking = judgement.ranking if judgement else None
    if ranking is None or ranking.average_precision is None or ranking.recall_at_1 is None:
        raise PlaceRecognitionError(
            f'{dataset.name}: the ground truth has no pair to be found; nothing can be compared'
        )
    return Run(
        dataset.name,
        variant,
        params.seed,
        ranking.average_precision,
        ranking.recall_at_1,
        perf_counter() - start,
    )


def _by_extractor(
    variants: Iterable[Variant], base: Params
) -> Iterator[tuple[Extractor, list[Variant]]]:
    """Yield extractors, one at a time as each keeps much, with the variants that need them."""
    groups: dict[tuple[str, int, int], list[Variant]] = {}
    for variant in variants:
        params = base.replace(**variant.changes)
        key = params.extractor, params.image_width, params.max_features
        groups.setdefault(key, []).append(variant)
    for (name, image_width, max_features), group in groups.items():
        extractor = create_extractor(
            name, image_width=image_width, max_features=max_features, threads=base.threads
        )
        yield KeepingExtractor(extractor), group
