# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
The experiment `hdc_experiments vectors`: compares variants of the image descriptor.

:data:`VARIANTS` lists the variants that parameters of the package select. The ideas below need
other code. A prototype measured them once on the same images (5 or 10 seeds, 25 shifts,
n = (6, 6)). The effects are differences of average precision on stromovka / planetarium /
corridor / fr1 desk / lip6. None of them is in the package.

====================================================  ==================================
idea                                                  effect, and why it was dropped
====================================================  ==================================
pooled descriptor (GeM of the network's head),        -.024/-.010/+.014/+.017/+.011: same
projected and bundled, weight .3                      mean, worse over seasons
the same, weight .5                                   -.08 on stromovka
average pooling, or pooling of block 10               worse or equal
running mean and variance of local features           -.008/-.001/-.016/+.002/+.004
variance of image vectors over the whole dataset      +.017/-.005/+.039/-.016/+.021: not
                                                      causal, an upper bound
signed square root of the image vector                -.005/+.002/+.019/-.011/+.005
exponential moving average, or a frozen mean          -.05 to -.2 on lip6
mean of the query's own session after 5 images,       +.062 on stromovka, R@1 .72 to .80;
instead of the mean of the database                   n_x = 8 gives the same without it
unit length again after standardization               -.001/.000/-.018/-.002/+.003
standardization without unit length                   worse
normalized rows, columns or blocks of the             within .006 of the Gaussian
projection; random signs                              projection
soft maximum or mean over shifts                      worse than the maximum
penalty on large shifts; dropping cells that leave    no difference
the image
====================================================  ==================================

Complex phasors with fractional binding were not tried: comparing 25 shifts already takes 5 ms.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
import csv
from dataclasses import asdict, fields
from pathlib import Path
from time import perf_counter

from hdc_place_recognition.datasets.open_dataset import open_dataset
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.progress import with_progress_bar
from hdc_place_recognition.experiments.runs import Plan, run_plan, Variant, VariantResult
from hdc_place_recognition.params.formats import add_arguments, from_arguments
from hdc_place_recognition.params.table import Value
import numpy as np

KEPT, DROPPED, DEFAULT = 'kept', 'dropped', 'default'

_NOT_SHIFTED: Mapping[str, Value] = {'displacements_x': 1, 'displacements_y': 1}

VARIANTS = (
    Variant('default', {}, DEFAULT, 'R@1 over seasons above .78'),
    Variant('no displacements', _NOT_SHIFTED, DROPPED, 'shifts improve every dataset'),
    Variant('5 x 1 displacements', {'displacements_y': 1}, DROPPED, 'hand-held cameras pitch'),
    Variant('5 x 3 displacements', {'displacements_y': 3}, DROPPED, 'they pitch by more than .1'),
    Variant(
        '3 x 3 displacements, step .1',
        {'displacements_x': 3, 'displacements_y': 3},
        DROPPED,
        'range too small',
    ),
    Variant(
        '3 x 3 displacements, step .2',
        {'displacements_x': 3, 'displacements_y': 3, 'displacement_step': 0.2},
        DROPPED,
        'step too large for n_x = 8',
    ),
    Variant('7 x 5 displacements', {'displacements_x': 7}, KEPT, 'slight gain, 40 % more shifts'),
    Variant(
        '9 x 9 displacements, step .05',
        {'displacements_x': 9, 'displacements_y': 9, 'displacement_step': 0.05},
        KEPT,
        'slight gain, three times the shifts',
    ),
    Variant('n = (6, 6)', {'n_x': 6}, KEPT, 'same mean, worse over seasons'),
    Variant(
        'n = (4, 6)', {'n_x': 4}, KEPT, "the paper's; better in the corridor, worse over seasons"
    ),
    Variant('n = (6, 4)', {'n_x': 6, 'n_y': 4}, KEPT, 'better on the desk, worse over seasons'),
    Variant('n = (8, 4)', {'n_y': 4}, KEPT, 'better on the desk, worse in the corridor'),
    Variant('n = (1, 1)', {'n_x': 1, 'n_y': 1}, DROPPED, 'positions are needed'),
    Variant('Gaussian projection', {'projection': 'gaussian'}, KEPT, "the paper's; no difference"),
    Variant('l2_center', {'preprocessing': 'l2_center'}, KEPT, "the paper's; slightly worse"),
    Variant(
        'no centering',
        {'center_database': False},
        DROPPED,
        'the component common to all images remains',
    ),
    Variant('d = 1024', {'dimensions': 1024}, KEPT, 'a quarter of the memory, clearly worse'),
    Variant('d = 2048', {'dimensions': 2048}, KEPT, 'half the memory, worse'),
    Variant('d = 8192', {'dimensions': 8192}, KEPT, 'slight gain, twice the memory'),
    Variant('image width 240', {'image_width': 240}, KEPT, 'faster, worse over seasons'),
    Variant('image width 512', {'image_width': 512}, DROPPED, 'slower, not better'),
    Variant('image width 640', {'image_width': 640}, DROPPED, 'slower and worse'),
    Variant(
        'sequences of 3', {'sequence_length': 3}, KEPT, 'only for the same route at the same speed'
    ),
    Variant(
        'sequences of 5', {'sequence_length': 5}, KEPT, 'only for the same route at the same speed'
    ),
    Variant(
        'plain HDC of the paper',
        {
            **_NOT_SHIFTED,
            'n_x': 4,
            'n_y': 6,
            'preprocessing': 'l2_center',
            'projection': 'gaussian',
            'center_database': False,
        },
        DROPPED,
        'the baseline',
    ),
)

# Every image is stored, and images are ranked by similarity only.
_ALL_PAIRS: Mapping[str, Value] = {'verify': False, 'keyframe_similarity': 1.0}
_NOTE = (
    'AP: mean of {seeds} seeds with its 95 % interval; then mean R@1. {runs} runs in '
    '{minutes:.1f} minutes, feature extraction included.'
)


def add_compare_descriptors(
    subparsers: argparse._SubParsersAction[argparse.ArgumentParser],
) -> None:
    """Add the subcommand `vectors`."""
    parser = subparsers.add_parser(
        'vectors',
        allow_abbrev=False,
        help='compare variants of the image descriptor',
        description='Run every variant of the image descriptor on all datasets with several '
        'seeds. The table shows average precision over all pairs and recall at 1.',
    )
    parser.add_argument(
        'inputs', nargs='+', type=Path, metavar='FOLDER', help='images/ with gt.npz or poses.csv'
    )
    parser.add_argument(
        '--seeds',
        type=int,
        default=10,
        metavar='N',
        help='number of seeds per variant [%(default)s]',
    )
    parser.add_argument(
        '--variants',
        nargs='+',
        metavar='NAME',
        choices=[variant.name for variant in VARIANTS],
        help='only these variants: '
        + ', '.join(variant.name for variant in VARIANTS).replace('%', '%%'),
    )
    parser.add_argument(
        '--output',
        type=Path,
        default=Path('results'),
        metavar='FOLDER',
        help='folder for vectors.csv (all runs) and vectors.md (table) [%(default)s]',
    )
    add_arguments(parser)
    parser.set_defaults(run=run_compare_descriptors)


def run_compare_descriptors(arguments: argparse.Namespace) -> str:
    """
    Run the experiment, write the files, and return the table.

    :raises PlaceRecognitionError: an input or a parameter is invalid, or vectors.csv exists.
    """
    plan = _plan(arguments)
    file = arguments.output / 'vectors.csv'
    if file.exists():
        raise PlaceRecognitionError(f'{file} exists already; use another --output')
    arguments.output.mkdir(parents=True, exist_ok=True)
    start = perf_counter()
    watched = with_progress_bar(run_plan(plan), plan.count, 'vectors', 'run')
    results = list(_write_csv(file, watched))
    note = _NOTE.format(
        seeds=len(plan.seeds), runs=len(results), minutes=(perf_counter() - start) / 60
    )
    text = f'{markdown(results, plan.variants)}\n\n{note}'
    file.with_suffix('.md').write_text(text + '\n', encoding='utf-8')
    return text


def _plan(arguments: argparse.Namespace) -> Plan:
    """Return the plan of a command line, with all inputs checked."""
    base = from_arguments(arguments).replace(**_ALL_PAIRS)
    if arguments.seeds < 1:
        raise PlaceRecognitionError(f'--seeds {arguments.seeds}: must be 1 or more')
    chosen = arguments.variants or [variant.name for variant in VARIANTS]
    datasets = [open_dataset(path) for path in arguments.inputs]
    names = [dataset.name for dataset in datasets]
    for dataset in datasets:
        if dataset.ground_truth is None:
            raise PlaceRecognitionError(
                f'{dataset.name}: no gt.npz and no poses.csv; ground truth is needed'
            )
        if names.count(dataset.name) > 1:
            raise PlaceRecognitionError(
                f'{dataset.name}: given twice; the table needs different names'
            )
    return Plan(
        datasets,
        [variant for variant in VARIANTS if variant.name in chosen],
        range(base.seed, base.seed + arguments.seeds),
        base,
    )


def _write_csv(file: Path, results: Iterable[VariantResult]) -> Iterator[VariantResult]:
    """Write each result as soon as it is available and yield it; an interrupt keeps the file."""
    with file.open('x', newline='', encoding='utf-8') as stream:
        writer = csv.DictWriter(stream, [item.name for item in fields(VariantResult)])
        writer.writeheader()
        for result in results:
            writer.writerow(asdict(result))
            stream.flush()
            yield result


# Student's t at 97.5 % for 1 to 30 degrees of freedom; the last value is used above 30 and gives
# an interval that is at most 4 % too wide.
# fmt: off
_T = (
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
    2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086,
    2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
)
# fmt: on


def half_interval(values: Sequence[float]) -> float | None:
    """Return half the width of the 95 % confidence interval of the mean; None for one value."""
    if len(values) < 2:
        return None
    t = _T[min(len(values) - 1, len(_T)) - 1]
    return float(t * np.std(values, ddof=1) / np.sqrt(len(values)))


def markdown(results: Sequence[VariantResult], variants: Sequence[Variant]) -> str:
    """
    Return the comparison as a markdown table with one row per variant.

    :param results: results of all variants on the same datasets with the same seeds.
    :param variants: variants in the order of the rows.
    """
    datasets = list(dict.fromkeys(result.dataset for result in results))
    rows = [('variant', 'changes', *datasets, 'mean AP', 'decision', 'why')]
    for variant in variants:
        changes = ' '.join(f'{name}={value}' for name, value in variant.changes.items())
        own = [result for result in results if result.variant == variant.name]
        cells = [_cell([result for result in own if result.dataset == name]) for name in datasets]
        rows.append((variant.name, changes, *cells, _mean(own), variant.decision, variant.why))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, tuple('-' * width for width in widths))
    lines = (' | '.join(map(str.ljust, row, widths)) for row in rows)
    return '\n'.join(f'| {line} |' for line in lines)


def _cell(results: Sequence[VariantResult]) -> str:
    """Return average precision with its interval, and recall at 1."""
    recall = np.mean([result.recall_at_1 for result in results])
    return f'{_with_interval([result.average_precision for result in results])}, {recall:.2f}'


def _mean(results: Sequence[VariantResult]) -> str:
    """Return the mean over datasets; the interval is over the means of the seeds."""
    seeds = sorted({result.seed for result in results})
    means = [
        float(np.mean([result.average_precision for result in results if result.seed == seed]))
        for seed in seeds
    ]
    return _with_interval(means)


def _with_interval(values: Sequence[float]) -> str:
    """Return the mean with half its 95 % interval."""
    half = half_interval(values)
    return f'{np.mean(values):.3f}' + ('' if half is None else f' ± {half:.3f}')
