# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What every part of the benchmark is told."""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.params.table import Params


@dataclass(frozen=True)
class Settings:
    """
    What is measured, and against what.

    :param bandwidth: of the memory, bytes a millisecond on one core.
    :param products: of float32 that one core adds up in a millisecond.
    :param sizes: rows of the databases that are asked.
    :param images: of the drive, which is driven twice.
    """

    params: Params
    bandwidth: float
    products: float
    sizes: tuple[int, ...]
    images: int
