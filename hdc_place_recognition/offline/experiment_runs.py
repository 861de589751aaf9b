# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs of variants over data sets and seeds, with each image looked at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
import logging
from time import perf_counter

from hdc_place_recognition.core.recognizer import PlaceRecognizer
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.local_features import Extractor
from hdc_place_recognition.features.registry import create_extractor
from hdc_place_recognition.offline.dataset import Dataset
from hdc_place_recognition.offline.evaluate import evaluate
from hdc_place_recognition.offline.experiment_cache import in_memory, KeepingExtractor
from hdc_place_recognition.offline.experiment_variants import Variant
from hdc_place_recognition.params.table import Params
import threadpoolctl

_log = logging.getLogger(__name__)


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
    judgement = evaluate(dataset, PlaceRecognizer(params, extractor)).judgement
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
