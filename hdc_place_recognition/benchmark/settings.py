# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The settings of a benchmark run, common to all parts."""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.params.table import Params


@dataclass(frozen=True)
class Settings:
    """
    Sizes and references of a benchmark run.

    :param bandwidth: read bandwidth of one core, bytes per millisecond.
    :param products: multiply-add rate of one core in float32, operations per millisecond.
    :param sizes: sizes of the databases that are searched, rows.
    :param images: images of a traverse, which is processed twice.
    """

    params: Params
    bandwidth: float
    products: float
    sizes: tuple[int, ...]
    images: int
