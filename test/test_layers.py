# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Imports run one way: ros -> core <- offline."""

import ast
from pathlib import Path

from conftest import ROOT

PACKAGE = 'hdc_place_recognition'
SOURCE = ROOT / PACKAGE
SHARED = {'errors', 'params', 'param_spec', 'images', 'cameras'}
# What each part may import of the package, besides itself.
ALLOWED = {
    'core': {'errors', 'params'},
    'features': {'core', 'errors'},
    'ros': {*SHARED, 'core', 'pipeline', 'params_io', 'odometry'},
    'offline': {*SHARED, 'border', 'core', 'pipeline', 'params_io', 'features'},
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
            found.add(node.module or '')
    return found


def modules(part: str) -> list[Path]:
    found = sorted((SOURCE / part).glob('*.py'))
    assert found
    return found


def test_imports_run_one_way():
    for part, allowed in ALLOWED.items():
        for path in modules(part):
            parts = {
                name.split('.')[1] for name in imports(path) if name.startswith(PACKAGE + '.')
            }
            assert parts <= {part, *allowed}, f'{path} imports {parts - {part, *allowed}}'


def test_the_core_knows_numpy_and_opencv_only():
    for path in modules('core'):
        outside = {name.split('.')[0] for name in imports(path)} - {PACKAGE}
        stdlib = {
            '__future__',
            'array',
            'bisect',
            'collections',
            'concurrent',
            'contextlib',
            'dataclasses',
            'enum',
            'functools',
            'time',
            'typing',
            'threading',
            'math',
            'itertools',
        }
        assert outside <= {*stdlib, 'cv2', 'numpy'}, f'{path} imports {outside - stdlib}'


def test_only_ros_demo_and_benchmark_import_ros():
    for path in SOURCE.rglob('*.py'):
        if not {'ros', 'demo', 'benchmark'} & set(path.relative_to(SOURCE).parts):
            names = {name.split('.')[0] for name in imports(path)}
            assert not names & OF_ROS, f'{path} imports {names & OF_ROS}'


def test_nothing_is_printed_but_by_commands():
    for path in SOURCE.rglob('*.py'):
        calls = [
            node.func.id
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        ]
        if 'print' in calls:
            assert 'def main(' in path.read_text() or 'demo' in path.parts, path
