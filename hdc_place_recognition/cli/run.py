# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Error handling of all commands: prints an error as one line and returns an exit code."""

from __future__ import annotations

from collections.abc import Callable
import logging
import sys

from hdc_place_recognition.errors import PlaceRecognitionError

BAD_INPUT, INTERRUPTED = 2, 130


def run_command(name: str, work: Callable[[], int]) -> int:
    """
    Run the main function of a command and return the exit code.

    :param name: name of the command, printed before an error.
    :param work: main function, returns the exit code.
    :return: the exit code of `work`; 2 if the input is invalid, 130 on Ctrl-C.
    """
    logging.basicConfig(level=logging.INFO, format='%(message)s', stream=sys.stderr)
    try:
        return work()
    except (PlaceRecognitionError, OSError) as error:
        sys.stderr.write(f'{name}: {error}\n')
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
