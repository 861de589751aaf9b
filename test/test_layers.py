# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A room imports only from the rooms below it, and only some rooms know ROS, files or printing."""

import ast
from pathlib import Path
import sys

from conftest import ROOT

PACKAGE = 'hdc_place_recognition'
SOURCE = ROOT / PACKAGE
# From the top floor down. Rooms on one floor do not import each other.
FLOORS = (
    ('demo', 'benchmark'),
    ('cli',),
    ('experiments',),
    ('api',),
    ('evaluation',),
    ('ros', 'datasets'),
    ('recognition',),
    ('verification',),
    ('database',),
    ('hdc',),
    ('features',),
    ('networks', 'conversions'),
    ('params',),
    ('results',),
    ('camera',),
    ('bounded_files',),
    ('errors',),
)
FLOOR = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
# Beside the standard library and numpy.
LIBRARIES: dict[str, set[str]] = {
    'hdc': set(),
    'database': set(),
    'verification': {'cv2'},
    'features': {'cv2'},
    'recognition': {'threadpoolctl', 'cv2'},
    'results': set(),
}
# What touches files, threads of its own or a terminal in the standard library.
NOT_PURE = {'argparse', 'csv', 'json', 'logging', 'os', 'pathlib', 'pickle', 'shutil', 'sys'}
# The vectors of a very large database lie in an anonymous file.
MAY = {
    'database/storage.py': {'os', 'pathlib'},
    # Said once: what an extractor without a grid goes without.
    'recognition/image_encoder.py': {'logging'},
    # Calibration tables are data, and the library logs once that there is none.
    'recognition/factory.py': {'pathlib', 'json', 'logging'},
}
OF_ROS = {'rclpy', 'rcl_interfaces', 'sensor_msgs', 'nav_msgs', 'std_msgs', 'diagnostic_msgs'}


def imports(path: Path) -> set[str]:
    """Return the dotted names that a file imports, wherever it does."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: relative import'
            module = node.module or ''
            found |= {f'{PACKAGE}.{alias.name}' for alias in node.names if module == PACKAGE}
            found.add(module)
    return found


def room(path: Path) -> str:
    """Return the room of a file of the package."""
    return path.relative_to(SOURCE).with_suffix('').parts[0]


def files(*rooms: str) -> list[Path]:
    """Return the files of some rooms, of all by default."""
    found = [
        path
        for path in sorted(SOURCE.rglob('*.py'))
        if path.parent != SOURCE or path.stem != '__init__'
    ]
    return [path for path in found if not rooms or room(path) in rooms]


def test_every_room_has_a_floor():
    assert {room(path) for path in files()} == set(FLOOR)


def test_rooms_import_from_below():
    for path in files():
        own = room(path)
        used = {name.split('.')[1] for name in imports(path) if name.startswith(PACKAGE + '.')}
        above = {target for target in used - {own} if FLOOR[target] <= FLOOR[own]}
        assert not above, f'{path} imports {above}'


def test_recognition_rooms_know_no_files_and_no_other_libraries():
    for path in files(*LIBRARIES):
        outside = {name.split('.')[0] for name in imports(path)} - {PACKAGE, 'numpy'}
        outside -= MAY.get(path.relative_to(SOURCE).as_posix(), set())
        assert not outside & NOT_PURE, f'{path} imports {outside & NOT_PURE}'
        libraries = outside - set(sys.stdlib_module_names) - LIBRARIES[room(path)]
        assert not libraries, f'{path} imports {libraries}'


def test_only_ros_demo_and_benchmark_import_ros():
    for path in files():
        if room(path) not in {'ros', 'demo', 'benchmark'}:
            names = {name.split('.')[0] for name in imports(path)}
            assert not names & OF_ROS, f'{path} imports {names & OF_ROS}'


def test_nothing_is_printed_but_by_commands():
    for path in files():
        calls = [
            node.func.id
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        ]
        if 'print' in calls:
            assert 'def main(' in path.read_text() or 'demo' in path.parts, path
