# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What the tests share."""

from __future__ import annotations

import logging
import os
from pathlib import Path
import sys

from hdc_place_recognition.features.local_features import LocalFeatures
import numpy as np
from numpy.typing import NDArray
import pytest

ROOT = Path(__file__).resolve().parent.parent
# Before anything imports rclpy: tests talk to this machine only, apart from other ROS systems.
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('ROS_DOMAIN_ID', '87')
os.environ.setdefault('AMENT_PREFIX_PATH', sys.prefix)
# launch, which the pytest plug-ins of launch_testing load, sets a class of loggers that do not
# propagate: caplog would see no record of the package.
logging.setLoggerClass(logging.Logger)


@pytest.fixture(autouse=True)
def propagating_loggers() -> None:
    """Let caplog see what loggers record that were made before this file was read."""
    for name, logger in logging.root.manager.loggerDict.items():
        if name.startswith('hdc_place_recognition') and isinstance(logger, logging.Logger):
            logger.propagate = True


class CellExtractor:
    """A tiny extractor: mean colors of a 4 x 4 grid of cells and of their neighbors below."""

    identity = 'cells'

    def extract(self, image: NDArray[np.uint8]) -> LocalFeatures:
        """Return 16 features, none for an image without contrast."""
        height, width = image.shape[:2]
        keypoints = np.array(
            [
                ((x + 0.5) * width / 4 - 0.5, (y + 0.5) * height / 4 - 0.5)
                for y in range(4)
                for x in range(4)
            ],
            np.float32,
        )
        gray = image if image.ndim == 2 else image.mean(axis=2)
        rows = [
            part.reshape(part.shape[0], part.shape[1] // 4, 4)
            for part in np.array_split(gray[:, : width // 4 * 4], 4, axis=0)
        ]
        means = np.array(
            [[part.reshape(part.shape[0], 4, -1)[:, x].mean() for x in range(4)] for part in rows]
        ).ravel()
        basis = np.random.default_rng(0).standard_normal((16, 32))
        waves = np.cos(np.outer(means, np.arange(1, 17) / 8)) @ basis
        count = 16 if gray.std() > 0 else 0
        return LocalFeatures(keypoints[:count], waves[:count].astype(np.float32), width, height)


@pytest.fixture
def cell_extractor() -> CellExtractor:
    """Return an extractor that needs no weights and a millisecond."""
    return CellExtractor()


@pytest.fixture
def shared_data() -> Path:
    """Return the folder of real sequences, or skip."""
    folder = ROOT.parent / 'shared' / 'data'
    if not folder.is_dir():
        pytest.skip(f'no development data at {folder}')
    return folder


def texture(seed: int, height: int = 48, width: int = 64) -> NDArray[np.uint8]:
    """Return a random gray image that differs in every part."""
    return np.random.default_rng(seed).integers(0, 256, (height, width), dtype=np.uint8)
