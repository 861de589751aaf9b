# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The node as a process of its own: how it starts and how it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip('rclpy', reason='needs ROS')

RUN = 'import sys; from hdc_place_recognition.ros.start import main; sys.exit(main())'
# Says when signals are handled: before that Python itself is starting.
LATE = RUN.replace('import sys;', 'import signal, sys;').replace(
    'sys.exit', "print('begin', flush=True); sys.exit"
)
# Needs no weights: these tests are about the process.
BASE = ('--ros-args', '-p', 'extractor:=gradient_grid')
SOON_S = 30.0


@pytest.fixture
def start() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Return a function that starts a node; one that is left over would disturb other tests."""
    started = []

    def run(*words: str, code: str = RUN) -> subprocess.Popen[str]:
        command = [sys.executable, '-c', code, *words]
        both = {'stdout': subprocess.PIPE, 'stderr': subprocess.STDOUT}
        started.append(subprocess.Popen(command, text=True, **both))
        return started[-1]

    yield run
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(
    'numbers', [[signal.SIGINT], [signal.SIGTERM], [signal.SIGINT, signal.SIGINT]]
)
def test_ends_cleanly(start, numbers):
    process = start(*BASE)
    assert process.stdout is not None
    uncalibrated, first = process.stdout.readline(), process.stdout.readline()
    # A log line of the library, through the logger of the node.
    assert '[WARN]' in uncalibrated and 'the score is not calibrated' in uncalibrated
    assert 'listening to /image' in first and 'gradient_grid' in first
    for number in numbers:
        process.send_signal(number)
    output, _ = process.communicate(timeout=SOON_S)
    assert process.returncode == 0, output
    assert 'Traceback' not in output


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_ends_cleanly_at_any_moment_of_the_start(start, number):
    # Loading the libraries takes about a second, creating the node another one.
    for after_s in (0.05, 0.2, 0.4, 0.7, 1.0, 1.3, 1.7, 2.2):
        process = start(*BASE, code=LATE)
        assert process.stdout is not None
        assert process.stdout.readline() == 'begin\n'
        time.sleep(after_s)
        process.send_signal(number)
        output, _ = process.communicate(timeout=SOON_S)
        assert process.returncode == 0, output
        assert 'Traceback' not in output and 'rror' not in output, output


def test_a_missing_package_is_one_line_and_2(start):
    code = "import sys; sys.modules['rclpy'] = None; " + RUN
    process = start(code=code)
    output, _ = process.communicate(timeout=SOON_S)
    assert process.returncode == 2
    assert output.startswith('place_recognition_node: the Python package rclpy is not installed')
    assert len(output.splitlines()) == 1


@pytest.mark.parametrize(
    ('words', 'named'),
    [
        (['-p', 'n_x:=0'], 'n_x'),
        (['-p', 'n_x:=two'], 'n_x'),
        (['-p', 'min_score:=high'], 'min_score'),
        (['-p', 'preprocessing:=whiten'], 'preprocessing'),
        (['--params-file', '/nowhere/p.yaml'], '/nowhere/p.yaml'),
        (['-p', 'n_x:=[1'], 'n_x'),
    ],
)
def test_bad_start_is_one_line_and_2(start, words, named):
    process = start(*BASE, *words)
    output, _ = process.communicate(timeout=SOON_S)
    assert process.returncode == 2, output
    assert len(output.strip().splitlines()) == 1 and named in output
    assert output.startswith('place_recognition_node: ')


def test_bad_override_of_quality_of_service_is_one_line_and_2(start):
    process = start(*BASE, '-p', 'qos_overrides./image.subscription.depth:=deep')
    output, _ = process.communicate(timeout=SOON_S)
    assert process.returncode == 2, output
    _uncalibrated, line = output.strip().splitlines()
    assert 'qos_overrides./image.subscription.depth' in line


def test_bad_parameter_file_is_one_line_and_2(start, tmp_path: Path):
    path = tmp_path / 'p.yaml'
    path.write_text('/**:\n  ros__parameters:\n    n_x: [1\n')
    process = start(*BASE, '--params-file', str(path))
    output, _ = process.communicate(timeout=SOON_S)
    assert process.returncode == 2, output
    assert len(output.strip().splitlines()) == 1


def test_integer_serves_for_a_float(start):
    process = start(*BASE, '-p', 'min_score:=1')
    assert process.stdout is not None
    assert any('listening' in line for line in process.stdout)
    process.send_signal(signal.SIGINT)
    assert process.wait(SOON_S) == 0
