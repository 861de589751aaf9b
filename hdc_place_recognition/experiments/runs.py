# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Runs variants of the image descriptor on datasets with several seeds.

Images are decoded once per dataset, and local features are extracted once per extractor.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
import hashlib
from itertools import product
import logging
from time import perf_counter

from hdc_place_recognition.datasets.dataset import Dataset, Frames
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.evaluate import evaluate
from hdc_place_recognition.features.local_features import Extractor, LocalFeatures
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.params.table import Params, Value
from hdc_place_recognition.recognition.factory import assemble
from hdc_place_recognition.results import Frame
import numpy as np
from numpy.typing import NDArray
import threadpoolctl

_log = logging.getLogger(__name__)

LIMIT_BYTES = 2**30  # of decoded images, and the same of local features


@dataclass(frozen=True)
class Variant:
    """
    One variant of the image descriptor.

    :param name: short name, for tables.
    :param changes: parameters that differ from the default.
    :param decision: kept (as an option), dropped, or default.
    :param why: reason of the decision in a few words.
    """

    name: str
    changes: Mapping[str, Value]
    decision: str
    why: str


@dataclass(frozen=True)
class Plan:
    """
    All combinations of datasets, variants and seeds.

    :param datasets: datasets with ground truth and different names.
    :param variants: variants of the image descriptor.
    :param seeds: seeds of the random vectors.
    :param base: parameters that the variants change.
    """

    datasets: Sequence[Dataset]
    variants: Sequence[Variant]
    seeds: Sequence[int]
    base: Params

    @property
    def count(self) -> int:
        """Return the number of runs."""
        return len(self.datasets) * len(self.variants) * len(self.seeds)


@dataclass(frozen=True)
class VariantResult:
    """
    Result of one variant on one dataset with one seed.

    :param average_precision: average precision over all pairs.
    :param recall_at_1: share of queries whose best match is correct.
    :param seconds: run time; only the first run with an extractor includes feature extraction.
    """

    dataset: str
    variant: str
    seed: int
    average_precision: float
    recall_at_1: float
    seconds: float


def run_plan(plan: Plan) -> Iterator[VariantResult]:
    """
    Yield the results of a plan, dataset by dataset.

    :raises PlaceRecognitionError: an image cannot be read, or a dataset has no pair to be found.
    """
    with threadpoolctl.threadpool_limits(plan.base.threads, user_api='blas'):
        for dataset in map(load_into_memory, plan.datasets):
            _log.info(
                '%s: %d variants, %d seeds', dataset.name, len(plan.variants), len(plan.seeds)
            )
            base = plan.base.replace(**dataset.overrides)
            for extractor, variants in _group_by_extractor(plan.variants, base):
                for variant, seed in product(variants, plan.seeds):
                    params = base.replace(**variant.changes, seed=seed)
                    yield _run(dataset, variant.name, params, extractor)


def _run(dataset: Dataset, variant: str, params: Params, extractor: Extractor) -> VariantResult:
    """Evaluate one variant."""
    start = perf_counter()
    scores = evaluate(dataset, assemble(params, extractor)).scores
    ranking = scores.ranking if scores else None
    if ranking is None or ranking.average_precision is None or ranking.recall_at_1 is None:
        raise PlaceRecognitionError(
            f'{dataset.name}: the ground truth has no pair to be found; use another dataset'
        )
    return VariantResult(
        dataset.name,
        variant,
        params.seed,
        ranking.average_precision,
        ranking.recall_at_1,
        perf_counter() - start,
    )


def _group_by_extractor(
    variants: Iterable[Variant], base: Params
) -> Iterator[tuple[Extractor, list[Variant]]]:
    """Yield extractors with their variants; only one extractor is in memory at a time."""
    groups: dict[tuple[str, int, int], list[Variant]] = {}
    for variant in variants:
        params = base.replace(**variant.changes)
        key = params.extractor, params.image_width, params.max_features
        groups.setdefault(key, []).append(variant)
    for (name, image_width, max_features), group in groups.items():
        extractor = create_extractor(
            name, image_width=image_width, max_features=max_features, threads=base.threads
        )
        yield CachingExtractor(extractor), group


class CachingExtractor:
    """
    An extractor that extracts the features of each image once.

    When the cache is full, new features are not stored. Evicting old ones would be useless: every
    run reads the images in the same order, so an evicted image would always be needed next.

    :param extractor: the wrapped extractor.
    :param limit_bytes: capacity of the cache.
    """

    def __init__(self, extractor: Extractor, limit_bytes: int = LIMIT_BYTES) -> None:
        self._extractor = extractor
        self._free_bytes = limit_bytes
        self._cache: dict[tuple[tuple[int, ...], bytes], LocalFeatures] = {}

    @property
    def identity(self) -> str:
        """Return the identity of the wrapped extractor."""
        return self._extractor.identity

    def extract(self, image: NDArray[np.uint8]) -> LocalFeatures:
        """Return the features of an image; the cache key is the hash of its pixels."""
        key = image.shape, hashlib.sha1(np.ascontiguousarray(image).data).digest()
        found = self._cache.get(key)
        if found is None:
            found = self._extractor.extract(image)
            self._store(key, found)
        return found

    def _store(self, key: tuple[tuple[int, ...], bytes], features: LocalFeatures) -> None:
        size = features.keypoints.nbytes + features.descriptors.nbytes
        if size <= self._free_bytes:
            self._free_bytes -= size
            self._cache[key] = features


def load_into_memory(dataset: Dataset) -> Dataset:
    """Return the dataset with decoded images, if they need at most LIMIT_BYTES."""
    return replace(
        dataset,
        queries=_decode(dataset.queries),
        reference=None if dataset.reference is None else _decode(dataset.reference),
    )


def _decode(frames: Frames) -> Frames:
    """Return a list of frames, or the frames unchanged if they are too large."""
    decoded: list[Frame] = []
    free_bytes = LIMIT_BYTES
    for frame in frames:
        free_bytes -= frame.image.nbytes
        if free_bytes < 0:
            return frames
        decoded.append(frame)
    return decoded
