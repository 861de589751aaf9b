# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command hdc_params: the table of parameters as a file or as README's table."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from hdc_place_recognition.cli.run import run_command
from hdc_place_recognition.params.formats import (
    add_arguments,
    dump_yaml,
    from_arguments,
    markdown_table,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Print the parameters; with a file or flags, print what they amount to."""
    parser = argparse.ArgumentParser(prog='hdc_params', description=__doc__)
    form = parser.add_mutually_exclusive_group(required=True)
    form.add_argument(
        '--yaml',
        action='store_true',
        help='as a file for --params-file; flags and a file change the defaults',
    )
    form.add_argument('--markdown', action='store_true', help='as a table')
    add_arguments(parser)
    arguments = parser.parse_args(argv)

    def work() -> int:
        text = markdown_table() if arguments.markdown else dump_yaml(from_arguments(arguments))
        print(text, end='')
        return 0

    return run_command('hdc_params', work)
