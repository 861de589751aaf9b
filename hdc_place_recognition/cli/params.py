# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command hdc_params: prints the parameters as a YAML file or as a Markdown table."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from hdc_place_recognition.cli.run import run_command
from hdc_place_recognition.params.formats import (
    add_arguments,
    candidate_fields_table,
    dump_yaml,
    from_arguments,
    markdown_table,
)


def main(argv: Sequence[str] | None = None) -> int:
    """
    Print the parameters, with the changes of a parameter file and of flags.

    :param argv: command-line arguments, by default those of the process.
    :return: exit code, 2 if a parameter is invalid.
    """
    parser = argparse.ArgumentParser(
        prog='hdc_params',
        description='Print the parameters as a YAML file or as a Markdown table.',
    )
    form = parser.add_mutually_exclusive_group(required=True)
    form.add_argument(
        '--yaml',
        action='store_true',
        help='print a file for --params-file, with the values of flags and of a given file',
    )
    form.add_argument(
        '--markdown', action='store_true', help='print a Markdown table of the defaults'
    )
    form.add_argument(
        '--candidate-fields',
        action='store_true',
        help='print a Markdown table of the fields of a candidate',
    )
    add_arguments(parser)
    arguments = parser.parse_args(argv)

    def work() -> int:
        if arguments.candidate_fields:
            text = candidate_fields_table()
        elif arguments.markdown:
            text = markdown_table()
        else:
            text = dump_yaml(from_arguments(arguments))
        print(text, end='')
        return 0

    return run_command('hdc_params', work)
