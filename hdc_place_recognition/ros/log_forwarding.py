# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Log lines of the library on /rosout, under the name of the node."""

from __future__ import annotations

import logging
from typing import Any

_LIBRARY = logging.getLogger('hdc_place_recognition')


class _RosHandler(logging.Handler):
    """Hands records to a logger of rclpy."""

    def __init__(self, logger: Any) -> None:
        super().__init__(logging.INFO)
        self._logger = logger

    def emit(self, record: logging.LogRecord) -> None:
        """Log a record at its own severity; rclpy allows one severity for a line of code."""
        text = record.getMessage()
        if record.levelno >= logging.ERROR:
            self._logger.error(text)
        elif record.levelno >= logging.WARNING:
            self._logger.warning(text)
        else:
            self._logger.info(text)


def forward_logs(logger: Any) -> logging.Handler:
    """Forward the library's log lines from INFO on to a logger of rclpy; return the handler."""
    handler = _RosHandler(logger)
    _LIBRARY.addHandler(handler)
    if _LIBRARY.getEffectiveLevel() > logging.INFO:
        _LIBRARY.setLevel(logging.INFO)
    return handler


def stop_forwarding(handler: logging.Handler) -> None:
    """End what :func:`forward_logs` began."""
    _LIBRARY.removeHandler(handler)
