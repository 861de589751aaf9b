# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Print how one image flows through the files of the package.

    .venv/bin/python test/flow.py [--extractor gradient_grid]

Prints the rooms with their files and lines, the longest chain of imports, and, for one image that
closes a loop, the files that it touches and the calls that cross from one file to another. The
image is processed by the recognizer alone and, if ROS is installed, by the node.
"""

from __future__ import annotations

import argparse
import ast
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
import sys
import threading
from types import FrameType
from typing import Any

import cv2
import hdc_place_recognition as hpr
import numpy as np
from numpy.typing import NDArray

PACKAGE = Path(hpr.__file__).parent
S = 1_000_000_000
# Views of a drive, and how many of them are seen again before the image that is counted.
VIEWS, SEEN_AGAIN = 30, 5
WIDTH, HEIGHT, STEP = 640, 480, 400
PARAMS = {'exclude_recent_s': 10.0, 'min_interval_s': 0.0}


@cache
def package_file(filename: str) -> str:
    """Return a path in the package, '' for a file outside of it."""
    path = Path(filename)
    return str(path.relative_to(PACKAGE)) if path.is_relative_to(PACKAGE) else ''


class Flow:
    """Counts the calls from one file of the package to another, in all threads made after it."""

    def __init__(self) -> None:
        self.files: set[str] = set()
        self.crossings: Counter[tuple[str, str]] = Counter()
        self._counting = False
        threading.setprofile(self._profile)

    @contextmanager
    def counted(self) -> Iterator[None]:
        """Count what happens inside."""
        self._counting = True
        sys.setprofile(self._profile)
        try:
            yield
        finally:
            sys.setprofile(None)
            self._counting = False

    def _profile(self, frame: FrameType, event: str, argument: object) -> None:
        """Note a call, or the next step of a generator, by the innermost caller in the package."""
        if not self._counting or event != 'call':
            return
        callee = package_file(frame.f_code.co_filename)
        if not callee:
            return
        self.files.add(callee)
        outer = frame.f_back
        while outer is not None and not package_file(outer.f_code.co_filename):
            outer = outer.f_back
        caller = package_file(outer.f_code.co_filename) if outer else ''
        if caller and caller != callee:
            self.crossings[caller, callee] += 1

    def show(self, title: str) -> None:
        """Print the numbers, and the calls behind them, most frequent first."""
        print(f'\n{title}: {len(self.files)} files, {self.crossings.total()} changes of file')
        for (caller, callee), count in self.crossings.most_common():
            print(f'{count:5}  {caller} -> {callee}')


def views() -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Yield stamps and images of a drive along a wall, whose beginning is seen again."""
    noise = np.random.default_rng(0).integers(0, 256, (HEIGHT // 8, VIEWS * STEP // 8))
    wall = cv2.resize(noise.astype(np.uint8), (VIEWS * STEP + WIDTH, HEIGHT))
    for second, place in enumerate([*range(VIEWS), *range(SEEN_AGAIN + 1)]):
        left, right = place * STEP, place * STEP + WIDTH
        yield second * S, wall[:, left:right].copy()


def follow(process: Callable[[int, NDArray[np.uint8]], Any], flow: Flow, title: str) -> None:
    """Process all views, count the last one, and print the flow."""
    *before, (stamp_ns, image) = views()
    for view in before:
        process(*view)
    with flow.counted():
        answer = process(stamp_ns, image)
    flow.show(title)
    print(f'       {answer}')


def follow_recognizer(extractor: str) -> None:
    """Print the flow through the recognizer."""
    flow = Flow()
    recognizer = hpr.create_recognizer(extractor=extractor, **PARAMS)
    recognizer.warm_up(WIDTH, HEIGHT)
    follow(
        lambda stamp_ns, image: recognizer.process(hpr.Frame(stamp_ns, image)).status.value,
        flow,
        'recognizer',
    )


def follow_node(extractor: str) -> None:
    """Print the flow through the node, from the callback of the message to what is published."""
    try:
        import rclpy
        from sensor_msgs.msg import Image
    except ImportError:
        print('\nnode: needs ROS')
        return
    from hdc_place_recognition.ros.node import PlaceRecognitionNode

    rclpy.init(args=[])
    flow = Flow()
    words = [f'{name}:={value}' for name, value in {'extractor': extractor, **PARAMS}.items()]
    arguments = [word for setting in words for word in ('-p', setting)]
    node = PlaceRecognitionNode(cli_args=['--ros-args', *arguments])
    (callback,) = (item.callback for item in node.subscriptions if item.msg_type is Image)

    def process(stamp_ns: int, image: NDArray[np.uint8]) -> str:
        message = Image(height=HEIGHT, width=WIDTH, step=WIDTH, encoding='mono8')
        message.data = image.tobytes()
        message.header.stamp.sec = stamp_ns // S
        callback(message)
        node.worker.wait_idle(10.0)
        return node.statistics.last_status

    follow(process, flow, 'node')
    node.destroy_node()
    rclpy.try_shutdown()


@cache
def imports(path: Path) -> tuple[Path, ...]:
    """Return the files of the package that a file imports when it is imported."""
    found: set[Path] = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                found |= module_file(f'{node.module}.{alias.name}') or module_file(node.module)
        elif isinstance(node, ast.Import):
            found = found.union(*(module_file(alias.name) for alias in node.names))
    return tuple(sorted(found))


def module_file(name: str) -> set[Path]:
    """Return the file of a module of the package; nothing for another name."""
    path = PACKAGE.parent / name.replace('.', '/')
    return {path.with_suffix('.py'), path / '__init__.py'} & FILES


@cache
def chain(path: Path) -> tuple[Path, ...]:
    """Return the longest chain of imports that begins with a file."""
    return (path, *max(map(chain, imports(path)), key=len, default=()))


FILES = frozenset(PACKAGE.rglob('*.py'))


def show_rooms() -> None:
    """Print files and lines of each room, and the longest chain of imports."""
    files: Counter[str] = Counter()
    lines: Counter[str] = Counter()
    for path in FILES:
        room = path.relative_to(PACKAGE).parts[0] if path.parent != PACKAGE else '(top)'
        files[room] += 1
        lines[room] += len(path.read_text().splitlines())
    for room in sorted(files):
        print(f'{room:14}{files[room]:4} files {lines[room]:6} lines')
    print(f'{"total":14}{files.total():4} files {lines.total():6} lines')
    longest = max(map(chain, sorted(FILES)), key=len)
    names = ' -> '.join(str(path.relative_to(PACKAGE)) for path in longest)
    print(f'\nlongest chain of imports: {len(longest)} files\n{names}')


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description='Print how one image flows through the files.')
    parser.add_argument('--extractor', default='efficientnet_lite0', help='default: %(default)s')
    options = parser.parse_args()
    show_rooms()
    follow_recognizer(options.extractor)
    follow_node(options.extractor)


if __name__ == '__main__':
    main()
