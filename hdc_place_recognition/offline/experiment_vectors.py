# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiment that chose the vector: every variant on every data set with every seed."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Mapping
import csv
from dataclasses import asdict, fields
from pathlib import Path
import sys
from time import perf_counter

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.offline.experiment_runs import measure, Plan, Run
from hdc_place_recognition.offline.experiment_tables import markdown
from hdc_place_recognition.offline.experiment_variants import VARIANTS
from hdc_place_recognition.offline.inputs import open_dataset
from hdc_place_recognition.offline.options import Options
from hdc_place_recognition.params.formats import add_arguments, from_arguments
from hdc_place_recognition.params.table import Value

# Every image is stored, and similarities alone are ranked.
_ALL_PAIRS: Mapping[str, Value] = {'verify': False, 'keyframe_similarity': 1.0}
_NOTE = (
    'AP: mean of {seeds} seeds with its 95 % interval; then mean R@1. {runs} runs in '
    '{minutes:.1f} minutes, extraction included.'
)


def add_vectors(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the experiment `vectors` to a command."""
    parser = subparsers.add_parser(
        'vectors',
        allow_abbrev=False,
        help='compare the variants of the vector',
        description='Run every variant of the vector on all data sets with several seeds: average '
        'precision over all pairs, and how often the best match is right.',
    )
    parser.add_argument(
        'inputs', nargs='+', type=Path, metavar='FOLDER', help='images/ with gt.npz or poses.csv'
    )
    parser.add_argument(
        '--seeds', type=int, default=10, metavar='N', help='runs of each variant [%(default)s]'
    )
    parser.add_argument(
        '--variants',
        nargs='+',
        metavar='NAME',
        choices=[variant.name for variant in VARIANTS],
        help='only these: ' + ', '.join(variant.name for variant in VARIANTS).replace('%', '%%'),
    )
    parser.add_argument(
        '--output',
        type=Path,
        default=Path('results'),
        metavar='FOLDER',
        help='where vectors.csv (every run) and vectors.md (the table) are made [%(default)s]',
    )
    add_arguments(parser)
    parser.set_defaults(run=run_vectors)


def run_vectors(arguments: argparse.Namespace) -> str:
    """
    Run the experiment, write its files, and return its table.

    :raises PlaceRecognitionError: input or a parameter is bad, or there are results already.
    """
    plan = _plan(arguments)
    file = arguments.output / 'vectors.csv'
    if file.exists():
        raise PlaceRecognitionError(f'{file} is there already; give another --output')
    arguments.output.mkdir(parents=True, exist_ok=True)
    start = perf_counter()
    runs = list(_written(file, _watched(measure(plan), plan.count)))
    note = _NOTE.format(
        seeds=len(plan.seeds), runs=len(runs), minutes=(perf_counter() - start) / 60
    )
    text = f'{markdown(runs, plan.variants)}\n\n{note}'
    file.with_suffix('.md').write_text(text + '\n', encoding='utf-8')
    return text


def _plan(arguments: argparse.Namespace) -> Plan:
    base = from_arguments(arguments).replace(**_ALL_PAIRS)
    if arguments.seeds < 1:
        raise PlaceRecognitionError(f'--seeds {arguments.seeds}: must be 1 or more')
    chosen = arguments.variants or [variant.name for variant in VARIANTS]
    datasets = [open_dataset(path, None, Options()) for path in arguments.inputs]
    names = [dataset.name for dataset in datasets]
    for dataset in datasets:
        if dataset.ground_truth is None:
            raise PlaceRecognitionError(
                f'{dataset.name}: no gt.npz and no poses.csv to compare by'
            )
        if names.count(dataset.name) > 1:
            raise PlaceRecognitionError(
                f'{dataset.name}: given twice, the table needs other names'
            )
    return Plan(
        datasets,
        [variant for variant in VARIANTS if variant.name in chosen],
        range(base.seed, base.seed + arguments.seeds),
        base,
    )


def _written(file: Path, runs: Iterable[Run]) -> Iterator[Run]:
    """Write each run as soon as it is there: an hour's work is not lost by the last minute."""
    with file.open('x', newline='', encoding='utf-8') as stream:
        writer = csv.DictWriter(stream, [item.name for item in fields(Run)])
        writer.writeheader()
        for run in runs:
            writer.writerow(asdict(run))
            stream.flush()
            yield run


def _watched(runs: Iterable[Run], count: int) -> Iterable[Run]:
    """Return the runs with a bar on a terminal that can show one."""
    if not sys.stderr.isatty():
        return runs
    try:
        from tqdm import tqdm
    except ImportError:
        return runs
    bar: Iterable[Run] = tqdm(runs, total=count, unit='run')
    return bar
