# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A progress bar on stderr."""

from __future__ import annotations

from collections.abc import Iterable
import sys
from typing import TypeVar

Item = TypeVar('Item')


def with_progress_bar(items: Iterable[Item], total: int, label: str, unit: str) -> Iterable[Item]:
    """Return the items; iterating them updates a bar if stderr is a terminal with tqdm."""
    if not sys.stderr.isatty():
        return items
    try:
        from tqdm import tqdm
    except ImportError:
        return items
    bar: Iterable[Item] = tqdm(items, total=total, desc=label, unit=unit)
    return bar
