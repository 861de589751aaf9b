# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The node in a separate process, with a database that is filled before the node spins."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
import subprocess
import sys
from typing import Any

from hdc_place_recognition.benchmark.filling import random_words
from hdc_place_recognition.benchmark.images import street
from hdc_place_recognition.benchmark.vectors import World
from hdc_place_recognition.database.base import Keyframe
from hdc_place_recognition.features.compact import CompactKeypoints, pack
from hdc_place_recognition.hdc.algebra import normalize
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
from hdc_place_recognition.results import Frame
from hdc_place_recognition.ros.main import main as run_node
from hdc_place_recognition.ros.node import PlaceRecognitionNode
import numpy as np
from numpy.typing import NDArray

TOPIC = '/benchmark/image'
# One of this many keyframes shows the published images; the others show other places.
_DRIVE_EVERY = 10
# Share of keypoints that are found again, with small changes in steps of the stored integers.
_FOUND_AGAIN = 0.4
_OTHER_LIGHT, _OTHER_PLACE = 1, 100
_VIEW_NOISE = 0.5
# Keyframes are older than any image.
_LONG_AGO_NS = 10**15
_SHUTDOWN_S = 10.0


@dataclass(frozen=True)
class LoadTask:
    """The images that are published to the node, and the keyframes that it has before."""

    keyframes: int
    images: int
    width: int
    height: int


@contextmanager
def node_process(task: LoadTask, params: Params) -> Iterator[subprocess.Popen[bytes]]:
    """
    Run the node in a separate process, and end it in any case.

    :param params: extractor and number of threads of the node.
    """
    numbers = (task.keyframes, task.images, task.width, task.height)
    options = ['--ros-args', '--log-level', 'warn', '-r', f'image:={TOPIC}']
    options += ['-p', 'min_interval_s:=0.0']
    for name in ('extractor', 'threads'):
        options += ['-p', f'{name}:={getattr(params, name)}']
    command = [sys.executable, '-m', __name__, *map(str, numbers), *options]
    process = subprocess.Popen(command)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(_SHUTDOWN_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def main(argv: Sequence[str]) -> int:
    """Run the node until it is interrupted."""
    task = LoadTask(*map(int, argv[:4]))

    def create() -> PlaceRecognitionNode:
        node = PlaceRecognitionNode()
        fill(node.recognizer, task)
        return node

    return run_node(argv[4:], create)


def fill(recognizer: PlaceRecognizer, task: LoadTask) -> None:
    """
    Fill a database with keyframes; for each published image it contains matches.

    The keypoints and dense cells are those of the published images, the keypoints with noise.
    Matching therefore takes as long as on a robot, and the geometry of true matches is computed
    too.
    """
    images = street(task.images, task.width, task.height)
    views = [recognizer.observe(Frame(0, image)).query for image in images]
    world, rng = World(task.keyframes), np.random.default_rng(0)
    for number in range(task.keyframes):
        visit, elsewhere = divmod(number, _DRIVE_EVERY)
        view = views[visit % len(views)]
        row = world.row(number)
        words = random_words(number) if elsewhere else view.words
        if not elsewhere:
            noise = _VIEW_NOISE * normalize(rng.standard_normal(row.shape, np.float32))
            row = normalize(view.unshifted + noise)
        keypoints = _seen_again(view.keypoints, rng) if view.keypoints else None
        keyframe = Keyframe(number, number - _LONG_AGO_NS, row, keypoints, words, view.cells)
        recognizer.database.add(keyframe)
    recognizer.start_traverse()


def _seen_again(keypoints: CompactKeypoints, rng: np.random.Generator) -> CompactKeypoints:
    """Return the keypoints a little elsewhere and in another light, most of them confused."""
    lost = np.flatnonzero(rng.random(len(keypoints)) > _FOUND_AGAIN)
    descriptors = _noisy(keypoints.descriptors, _OTHER_LIGHT, rng)
    descriptors[lost] = descriptors[lost][:, rng.permutation(descriptors.shape[1])]
    positions = _noisy(keypoints.positions, _OTHER_PLACE, rng)
    positions = np.clip(positions, 0, np.iinfo(np.uint16).max).astype(np.uint16)
    return replace(keypoints, positions=positions, packed=pack(descriptors))


def _noisy(values: NDArray[Any], most: int, rng: np.random.Generator) -> NDArray[Any]:
    noise = rng.integers(-most, most + 1, values.shape, np.int32)
    return values + noise


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
