# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
The variants of the vector that are compared, and what was tried outside the package.

:data:`VARIANTS` are settings of the package: `hdc_experiments vectors` measures them again. The
leads below need other code; a prototype measured them once on the same images (5 or 10 seeds, 25
displacements, n = (6, 6)). Effects are differences of AP on stromovka / planetarium / corridor /
fr1 desk / lip6. None is in the package.

====================================================  ==================================
lead                                                  effect, and why it was dropped
====================================================  ==================================
pooled vector (GeM of the network's head) projected   -.024/-.010/+.014/+.017/+.011: the
and bundled in, weight .3                             mean is equal, seasons lose
the same, weight .5                                   -.08 on stromovka
pooled by average or from block 10, its root          worse or equal
running mean and variance of local features           -.008/-.001/-.016/+.002/+.004
variance of whole vectors, of the whole set           +.017/-.005/+.039/-.016/+.021: not
                                                      causal, an upper bound
signed square root of the vector                      -.005/+.002/+.019/-.011/+.005
mean that fades out (EMA), or is frozen               -.05 to -.2 on lip6
mean of the query's own session, after 5 of the       +.062 on stromovka, R@1 .72 to .80;
database's                                            n_x = 8 reaches this without it
unit length again after standardizing                 -.001/.000/-.018/-.002/+.003
standardizing without unit lengths                    worse
rows, columns or blocks of the projection             within .006 of the Gaussian one
normalized, random signs
soft maximum or mean over displacements               below the maximum
penalty on displacements, or cells that leave the     no difference
image left out
====================================================  ==================================

Phasors with fractional binding were not tried: 25 displacements cost 5 ms as it is.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
import csv
from dataclasses import asdict, fields
from pathlib import Path
import sys
from time import perf_counter

from hdc_place_recognition.datasets.open_dataset import open_dataset, Options
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.experiments.runs import measure, Plan, Run, Variant
from hdc_place_recognition.params.formats import add_arguments, from_arguments
from hdc_place_recognition.params.table import Value
import numpy as np

KEPT, DROPPED, DEFAULT = 'kept', 'dropped', 'default'


_NOT_DISPLACED: Mapping[str, Value] = {'displacements_x': 1, 'displacements_y': 1}

VARIANTS = (
    Variant('default', {}, DEFAULT, 'over seasons R@1 above .78'),
    Variant('no displacements', _NOT_DISPLACED, DROPPED, 'every set gains by displacements'),
    Variant('5 x 1 displacements', {'displacements_y': 1}, DROPPED, 'hand-held cameras nod'),
    Variant('5 x 3 displacements', {'displacements_y': 3}, DROPPED, 'they nod by more than .1'),
    Variant(
        '3 x 3 displacements, step .1',
        {'displacements_x': 3, 'displacements_y': 3},
        DROPPED,
        'do not reach far enough',
    ),
    Variant(
        '3 x 3 displacements, step .2',
        {'displacements_x': 3, 'displacements_y': 3, 'displacement_step': 0.2},
        DROPPED,
        'too coarse for eighths of the width',
    ),
    Variant('7 x 5 displacements', {'displacements_x': 7}, KEPT, 'slight gain, 40 % more forms'),
    Variant(
        '9 x 9 displacements, step .05',
        {'displacements_x': 9, 'displacements_y': 9, 'displacement_step': 0.05},
        KEPT,
        'slight gain, three times the forms',
    ),
    Variant('n = (6, 6)', {'n_x': 6}, KEPT, 'equal mean, seasons lose'),
    Variant('n = (4, 6)', {'n_x': 4}, KEPT, "the paper's: corridor gains, seasons lose"),
    Variant('n = (6, 4)', {'n_x': 6, 'n_y': 4}, KEPT, 'desk gains, seasons lose'),
    Variant('n = (8, 4)', {'n_y': 4}, KEPT, 'desk gains, corridor loses'),
    Variant('n = (1, 1)', {'n_x': 1, 'n_y': 1}, DROPPED, 'positions count'),
    Variant('Gaussian projection', {'projection': 'gaussian'}, KEPT, "the paper's; no difference"),
    Variant('l2_center', {'preprocessing': 'l2_center'}, KEPT, "the paper's; slightly worse"),
    Variant('no centering', {'center_database': False}, DROPPED, 'what all images share remains'),
    Variant('d = 1024', {'dimensions': 1024}, KEPT, 'a quarter of the memory, clearly worse'),
    Variant('d = 2048', {'dimensions': 2048}, KEPT, 'half the memory, worse'),
    Variant('d = 8192', {'dimensions': 8192}, KEPT, 'slight gain, twice the memory'),
    Variant('image width 240', {'image_width': 240}, KEPT, 'faster, seasons lose'),
    Variant('image width 512', {'image_width': 512}, DROPPED, 'slower and no better'),
    Variant('image width 640', {'image_width': 640}, DROPPED, 'slower and worse'),
    Variant('sequences of 3', {'sequence_length': 3}, KEPT, 'same route at the same speed only'),
    Variant('sequences of 5', {'sequence_length': 5}, KEPT, 'same route at the same speed only'),
    Variant(
        'plain HDC of the paper',
        {
            **_NOT_DISPLACED,
            'n_x': 4,
            'n_y': 6,
            'preprocessing': 'l2_center',
            'projection': 'gaussian',
            'center_database': False,
        },
        DROPPED,
        'the base line',
    ),
)


# Student's t at 97.5 % for 1 to 30 degrees of freedom; beyond, the last is 4 % too wide at most.
# fmt: off
_T = (
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
    2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086,
    2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
)
# fmt: on


def half_interval(values: Sequence[float]) -> float | None:
    """Return half the width of the mean's 95 % t-interval; None for a single value."""
    if len(values) < 2:
        return None
    t = _T[min(len(values) - 1, len(_T)) - 1]
    return float(t * np.std(values, ddof=1) / np.sqrt(len(values)))


def markdown(runs: Sequence[Run], variants: Sequence[Variant]) -> str:
    """
    Return the comparison as a markdown table, a row for each variant.

    :param runs: of the variants, each on the same data sets with the same seeds.
    :param variants: in the order of the rows.
    """
    datasets = list(dict.fromkeys(run.dataset for run in runs))
    rows = [('variant', 'changes', *datasets, 'mean AP', 'verdict', 'why')]
    for variant in variants:
        changes = ' '.join(f'{name}={value}' for name, value in variant.changes.items())
        own = [run for run in runs if run.variant == variant.name]
        cells = [_cell([run for run in own if run.dataset == name]) for name in datasets]
        rows.append((variant.name, changes, *cells, _mean(own), variant.verdict, variant.why))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, tuple('-' * width for width in widths))
    lines = (' | '.join(map(str.ljust, row, widths)) for row in rows)
    return '\n'.join(f'| {line} |' for line in lines)


def _cell(runs: Sequence[Run]) -> str:
    recall = np.mean([run.recall_at_1 for run in runs])
    return f'{_with_interval([run.average_precision for run in runs])}, {recall:.2f}'


def _mean(runs: Sequence[Run]) -> str:
    """Return the mean over data sets; its interval is over seeds, each a mean over data sets."""
    seeds = sorted({run.seed for run in runs})
    means = [
        float(np.mean([run.average_precision for run in runs if run.seed == seed]))
        for seed in seeds
    ]
    return _with_interval(means)


def _with_interval(values: Sequence[float]) -> str:
    half = half_interval(values)
    return f'{np.mean(values):.3f}' + ('' if half is None else f' ± {half:.3f}')


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
