# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command hdc_benchmark: what everything costs, against what the machine can do at best."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
import logging
from pathlib import Path
import sys

import cv2
from hdc_place_recognition.benchmark.parts import LARGE_PARTS, PARTS
from hdc_place_recognition.benchmark.report import table, write
from hdc_place_recognition.benchmark.settings import Settings
from hdc_place_recognition.benchmark.timing import Measurement, multiplication_rate, read_bandwidth
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params
import threadpoolctl

_log = logging.getLogger(__name__)
_SIZES, _LARGE = (1_000, 10_000), 100_000


def main(argv: Sequence[str] | None = None) -> int:
    """
    Measure, print the table, and write it.

    :param argv: arguments of the command line, those of the process by default.
    :return: exit code; 2 if something cannot run.
    """
    logging.basicConfig(level=logging.INFO, format='%(message)s', stream=sys.stderr)
    arguments = _parser().parse_args(argv)
    try:
        measurements = list(_measure(arguments))
        print(table(measurements))
        for file in write(measurements, arguments.output):
            print(f'-> {file}')
    except (PlaceRecognitionError, OSError) as error:
        print(f'hdc_benchmark: {error}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='hdc_benchmark', description=__doc__)
    parser.add_argument(
        '--sizes',
        type=_positive,
        nargs='+',
        default=list(_SIZES),
        metavar='ROWS',
        help='of the databases that are asked [%(default)s]',
    )
    parser.add_argument(
        '--large',
        action='store_true',
        help=f'also search {_LARGE} rows and measure {", ".join(sorted(LARGE_PARTS))}: minutes, '
        'gigabytes of memory, and 8 GB in the folder of temporary files',
    )
    parser.add_argument(
        '--only',
        choices=PARTS,
        nargs='+',
        help='measure only this, rather than '
        f'{", ".join(name for name in PARTS if name not in LARGE_PARTS)}',
    )
    parser.add_argument(
        '--images', type=_positive, default=40, help='of the drive, driven twice [%(default)s]'
    )
    parser.add_argument(
        '--output',
        type=Path,
        default=Path('results'),
        metavar='FOLDER',
        help='where benchmark.json and plots are written [%(default)s]',
    )
    return parser


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f'{value}: must be 1 or more')
    return value


def _measure(arguments: argparse.Namespace) -> Iterator[Measurement]:
    """Yield all that was asked for; but for the node, on one thread."""
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
    """Return whether a part was asked for."""
    if arguments.only:
        return name in arguments.only
    return arguments.large or name not in LARGE_PARTS
