# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The score and the report of the demo."""

from __future__ import annotations

from pathlib import Path

from hdc_place_recognition.datasets.poses import Poses
from hdc_place_recognition.demo.route import Route
from hdc_place_recognition.results import Candidate, Reason
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS')
run = pytest.importorskip('hdc_place_recognition.demo.run', reason='needs ROS')


@pytest.fixture
def drive(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the stamps of the images of two laps, whose odometry is known."""
    odometry = list(Route(2.0).odometry())
    rows = [
        [pose.x, pose.y, 0, 0, 0, np.sin(pose.yaw / 2), np.cos(pose.yaw / 2)]
        for pose in (moment.pose for moment in odometry)
    ]
    poses = Poses.from_rows([moment.stamp_ns for moment in odometry], rows, 'odometry')
    monkeypatch.setattr(run, 'read_poses', lambda bag, topic: poses)
    return [moment.stamp_ns for moment in Route(2.0).images()]


def closure(query_ns: int, match_ns: int) -> Candidate:
    return Candidate(query_ns, match_ns, 0, 0.9, 0.99, 50, True, Reason.ACCEPTED, 0.0, 0.0)


def test_true_and_false_closures_are_counted(drive):
    lap = len(drive) // 2
    closures = [closure(drive[index], drive[index - lap]) for index in range(lap, len(drive))]
    wrong = closure(drive[-1], drive[lap // 2])
    found = run.score(Path('bag'), '/odom', drive, [*closures, wrong])
    assert found.false == 1 and found.true + found.ignored == len(closures)
    assert found.true > 0.8 * len(closures)
    # The second lap, without matches of the last seconds.
    assert 0.8 * lap < found.queries_with_match <= len(drive) - lap + 5


def test_no_closures_at_all(drive):
    found = run.score(Path('bag'), '/odom', drive, [])
    assert found.precision is None and found.recall == 0
    assert run.report(found) == 1


def test_report_wants_full_precision_and_most_of_the_loop(drive, capsys):
    lap = len(drive) // 2
    closures = [closure(drive[index], drive[index - lap]) for index in range(lap, len(drive))]
    assert run.report(run.score(Path('bag'), '/odom', drive, closures)) == 0
    assert 'precision 1.000' in capsys.readouterr().out
    wrong = closure(drive[-1], drive[lap // 2])
    assert run.report(run.score(Path('bag'), '/odom', drive, [*closures, wrong])) == 1


def test_unfinished_bag_is_rendered_again(tmp_path, monkeypatch, capsys):
    def write(path: Path) -> None:
        path.mkdir()
        (path / 'whole').touch()

    monkeypatch.setattr(run, 'write_bag', write)
    (tmp_path / 'bag.unfinished').mkdir()
    (tmp_path / 'bag.unfinished' / 'part').touch()
    run.render(tmp_path / 'bag')
    assert [path.name for path in (tmp_path / 'bag').iterdir()] == ['whole']
    assert 'rendering' in capsys.readouterr().out
    run.render(tmp_path / 'bag')
    assert capsys.readouterr().out == ''
