# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command hdc_experiments: repeats the experiments that chose defaults and constants."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from hdc_place_recognition.cli.run import run_command
from hdc_place_recognition.experiments.calibration import add_calibrate
from hdc_place_recognition.experiments.compare_descriptors import add_compare_descriptors
from hdc_place_recognition.experiments.operating_point import add_operating_point
from hdc_place_recognition.experiments.view_shift import add_shift


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run one experiment and print its table.

    :param argv: command-line arguments, by default those of the process.
    :return: exit code, 2 if an input or a parameter is invalid.
    """
    arguments = _parser().parse_args(argv)

    def work() -> int:
        print(arguments.run(arguments))
        return 0

    return run_command(f'hdc_experiments {arguments.experiment}', work)


def _parser() -> argparse.ArgumentParser:
    """Return the parser; every subcommand sets `run`, a function that returns the output."""
    parser = argparse.ArgumentParser(
        prog='hdc_experiments',
        allow_abbrev=False,
        description='Repeat the experiments that chose the default parameters and the constants '
        'of verification.',
    )
    subparsers = parser.add_subparsers(dest='experiment', required=True, metavar='EXPERIMENT')
    add_compare_descriptors(subparsers)
    add_shift(subparsers)
    add_calibrate(subparsers)
    add_operating_point(subparsers)
    return parser
