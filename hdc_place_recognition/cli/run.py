# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The border of every command: where errors become one line and an exit code."""

from __future__ import annotations

from collections.abc import Callable
import logging
import sys

from hdc_place_recognition.errors import PlaceRecognitionError

BAD_INPUT, INTERRUPTED = 2, 130


def run_command(name: str, work: Callable[[], int]) -> int:
    """
    Do a command's work and return its exit code.

    :param name: of the command, before the error's line.
    :param work: what returns the exit code if nothing is wrong.
    :return: that, or 2 if the input is bad, or 130 if the user has interrupted it.
    """
    logging.basicConfig(level=logging.INFO, format='%(message)s', stream=sys.stderr)
    try:
        return work()
    except (PlaceRecognitionError, OSError) as error:
        sys.stderr.write(f'{name}: {error}\n')
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
