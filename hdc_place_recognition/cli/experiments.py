# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command hdc_experiments: what the choices of the package were made by, to be repeated."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from hdc_place_recognition.cli.run import run_command
from hdc_place_recognition.experiments.calibration import add_calibrate
from hdc_place_recognition.experiments.compare_descriptors import add_vectors
from hdc_place_recognition.experiments.operating_point import add_trust
from hdc_place_recognition.experiments.view_shift import add_shift


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run one experiment and print its table.

    :param argv: arguments of the command line, those of the process by default.
    :return: exit code; 2 if the input or a parameter is bad.
    """
    arguments = _parser().parse_args(argv)

    def work() -> int:
        print(arguments.run(arguments))
        return 0

    return run_command(f'hdc_experiments {arguments.experiment}', work)


def _parser() -> argparse.ArgumentParser:
    """Return the parser; each experiment sets `run`, which returns the text to print."""
    parser = argparse.ArgumentParser(
        prog='hdc_experiments',
        allow_abbrev=False,
        description='Repeat the measurements by which the package was made what it is.',
    )
    subparsers = parser.add_subparsers(dest='experiment', required=True, metavar='EXPERIMENT')
    add_vectors(subparsers)
    add_shift(subparsers)
    add_calibrate(subparsers)
    add_trust(subparsers)
    return parser
