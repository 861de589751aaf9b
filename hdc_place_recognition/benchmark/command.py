# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command hdc_benchmark: the cost of every part, as a ratio to the limits of the machine."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
import logging
from pathlib import Path
from types import MappingProxyType

import cv2
from hdc_place_recognition.benchmark.encoding import measure_encoding
from hdc_place_recognition.benchmark.images import measure_extraction, measure_pipeline
from hdc_place_recognition.benchmark.memory import measure_memory, measure_million
from hdc_place_recognition.benchmark.node import measure_node
from hdc_place_recognition.benchmark.report import table, write
from hdc_place_recognition.benchmark.search import measure_search
from hdc_place_recognition.benchmark.settings import Settings
from hdc_place_recognition.benchmark.timing import Measurement, multiplication_rate, read_bandwidth
from hdc_place_recognition.cli.run import run_command
from hdc_place_recognition.params.table import Params
import threadpoolctl

_log = logging.getLogger(__name__)
_SIZES, _LARGE = (1_000, 10_000), 100_000
# In the order of measurement.
PARTS: Mapping[str, Callable[[Settings], Iterator[Measurement]]] = MappingProxyType(
    {
        'encoding': measure_encoding,
        'search': measure_search,
        'extraction': measure_extraction,
        'pipeline': measure_pipeline,
        'node': measure_node,
        'memory': measure_memory,
        'million': measure_million,
    }
)
# These take minutes or gigabytes and are measured only on request.
LARGE_PARTS = frozenset({'memory', 'million'})


def main(argv: Sequence[str] | None = None) -> int:
    """
    Measure, print the table and write the results.

    :param argv: arguments of the command line, those of the process by default.
    :return: exit code; 2 if a part cannot run.
    """
    arguments = _parser().parse_args(argv)

    def work() -> int:
        measurements = list(_measure(arguments))
        print(table(measurements))
        for file in write(measurements, arguments.output):
            print(f'-> {file}')
        return 0

    return run_command('hdc_benchmark', work)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='hdc_benchmark', description=__doc__)
    parser.add_argument(
        '--sizes',
        type=_positive,
        nargs='+',
        default=list(_SIZES),
        metavar='ROWS',
        help='sizes of the databases that are searched [%(default)s]',
    )
    parser.add_argument(
        '--large',
        action='store_true',
        help=f'also search {_LARGE} rows and measure {", ".join(sorted(LARGE_PARTS))}; takes '
        'minutes, gigabytes of memory and 8 GB in the folder for temporary files',
    )
    parser.add_argument(
        '--only',
        choices=PARTS,
        nargs='+',
        help='measure only these parts; default: '
        f'{", ".join(name for name in PARTS if name not in LARGE_PARTS)}',
    )
    parser.add_argument(
        '--images',
        type=_positive,
        default=40,
        help='images of a traverse, run twice [%(default)s]',
    )
    parser.add_argument(
        '--output',
        type=Path,
        default=Path('results'),
        metavar='FOLDER',
        help='folder for benchmark.json and plots [%(default)s]',
    )
    return parser


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f'{value}: must be 1 or more')
    return value


def _measure(arguments: argparse.Namespace) -> Iterator[Measurement]:
    """Yield the measurements of all requested parts, on one thread except for the node."""
    params = Params(exclude_recent_s=10.0, threads=1)
    cv2.setNumThreads(params.threads)
    with threadpoolctl.threadpool_limits(params.threads, user_api='blas'):
        settings = Settings(
            params=params,
            bandwidth=read_bandwidth(),
            products=multiplication_rate(),
            sizes=(*arguments.sizes, *([_LARGE] if arguments.large else [])),
            images=arguments.images,
        )
        yield Measurement('read bandwidth', settings.bandwidth / 1e6, 'GB/s')
        yield Measurement('float32 products', settings.products / 1e6, 'G/s')
        for name, measure in PARTS.items():
            if _wanted(name, arguments):
                _log.info('measuring %s', name)
                yield from measure(settings)


def _wanted(name: str, arguments: argparse.Namespace) -> bool:
    """Return whether a part was requested."""
    if arguments.only:
        return name in arguments.only
    return arguments.large or name not in LARGE_PARTS
