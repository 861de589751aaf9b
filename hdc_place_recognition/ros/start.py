# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command place_recognition_node: heeds signals already while the libraries are loaded."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType


def main() -> int:
    """Run the node; 2 if a package is missing, with one line that names it."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _leave)
    try:
        from hdc_place_recognition.ros.main import main as run
    except ModuleNotFoundError as error:
        package = str(error.name).partition('.')[0]
        print(
            f'place_recognition_node: the Python package {package} is not installed; see '
            f'README, "On a robot"',
            file=sys.stderr,
        )
        return 2
    return run()


def _leave(number: int, frame: FrameType | None) -> None:
    """End at once: there is nothing to clean up yet, and an exception may interrupt an import."""
    os._exit(0)
