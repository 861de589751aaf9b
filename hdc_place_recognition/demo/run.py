# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command hdc_demo: drive a loop twice, through the real node."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import shutil
import subprocess
import sys

from hdc_place_recognition.cli.run import run_command
from hdc_place_recognition.datasets.bags import read_poses
from hdc_place_recognition.datasets.ground_truth import PoseTruth
from hdc_place_recognition.datasets.open_dataset import Options
from hdc_place_recognition.demo.bag import (
    CAMERA_INFO_TOPIC,
    IMAGE_TOPIC,
    ODOMETRY_TOPIC,
    write_bag,
)
from hdc_place_recognition.demo.play import Player, raw_messages
from hdc_place_recognition.evaluation.metrics import Closures, count_closures
from hdc_place_recognition.params.formats import NODE_NAME
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.frame_filter import nanoseconds
from hdc_place_recognition.results import Candidate
import numpy as np
import rclpy

GOOD_RECALL = 0.9
_SHUTDOWN_S = 10.0


def main(argv: Sequence[str] | None = None) -> int:
    """Render the drive, play it through the node and report; 1 if closures are false or few."""
    parser = argparse.ArgumentParser(prog='hdc_demo', description=__doc__)
    parser.add_argument(
        '--bag',
        type=Path,
        default=Path('demo_bag'),
        help='folder of the bag; rendered if it does not exist [%(default)s]',
    )
    parser.add_argument('--render-only', action='store_true', help='write the bag and exit')
    arguments = parser.parse_args(argv)

    def work() -> int:
        render(arguments.bag)
        return 0 if arguments.render_only else run(arguments.bag)

    return run_command('hdc_demo', work)


def render(bag: Path) -> None:
    """Write the bag unless it exists; an interrupted rendering leaves no bag."""
    if bag.exists():
        return
    print(f'rendering a drive around the block, twice -> {bag}', flush=True)
    scratch = bag.with_name(bag.name + '.unfinished')
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir(parents=True)
    # The files in a bag are named after its folder, so that it needs its final name here.
    write_bag(scratch / bag.name)
    (scratch / bag.name).rename(bag)
    scratch.rmdir()


def run(bag: Path) -> int:
    """Play the bag through the node; return the exit code."""
    # ROS from PyPI finds its packages by this variable; a sourced ROS 2 has set it.
    os.environ.setdefault('AMENT_PREFIX_PATH', sys.prefix)
    rclpy.init(args=[])
    with node_process() as process:
        player = Player()
        player.wait_for_node(lambda: process.poll() is None)
        print(f'playing {bag} through {IMAGE_TOPIC} and {ODOMETRY_TOPIC}', flush=True)
        player.play(raw_messages(bag))
        player.destroy_node()
    rclpy.try_shutdown()
    return report(score(bag, ODOMETRY_TOPIC, player.answered_ns, player.closures))


def report(closures: Closures) -> int:
    """Print the comparison of closures and odometry; return the exit code."""
    precision, recall = closures.precision or 0.0, closures.recall or 0.0
    print(
        f'closures: {closures.true} true, {closures.false} false, {closures.ignored} ignored; '
        f'queries with a match: {closures.queries_with_match}, found: {closures.queries_found}'
    )
    print(f'precision {precision:.3f}  recall {recall:.3f}')
    return 0 if precision == 1 and recall >= GOOD_RECALL else 1


def score(
    bag: Path, odometry_topic: str, answered_ns: Sequence[int], closures: Sequence[Candidate]
) -> Closures:
    """
    Count true and false closures by the odometry, with the defaults of hdc_evaluate.

    :param answered_ns: stamps of all images that the node answered, ascending.
    :param closures: the accepted candidates.
    """
    poses = read_poses(bag, odometry_topic)
    rules = Options()
    truth = PoseTruth(
        queries=poses,
        database=poses,
        radius_m=rules.radius_m,
        max_angle_deg=rules.max_angle_deg,
        view_axis='x',
        tolerance_ns=nanoseconds(rules.pose_tolerance_s),
    )
    stamps = np.array(answered_ns, np.int64)
    found = truth.truth(stamps, stamps)
    old_enough_ns = nanoseconds(Params().exclude_recent_s)
    eligible = np.asarray(stamps[:, None] - stamps[None] >= old_enough_ns)
    pairs = [
        (
            int(np.searchsorted(stamps, closure.query_stamp_ns)),
            int(np.searchsorted(stamps, closure.match_stamp_ns)),
        )
        for closure in closures
    ]
    has_match = np.asarray((found.hard & eligible).any(axis=1))
    return count_closures(pairs, found.hard, found.soft, has_match)


@contextmanager
def node_process() -> Iterator[subprocess.Popen[bytes]]:
    """Run the node in its own process, as on a robot."""
    executable = Path(sys.argv[0]).resolve().with_name(NODE_NAME)
    process = subprocess.Popen(
        [
            str(executable),
            '--ros-args',
            '--log-level',
            f'{NODE_NAME}:=warn',
            '-r',
            f'image:={IMAGE_TOPIC}',
            '-r',
            f'camera_info:={CAMERA_INFO_TOPIC}',
            '-r',
            f'odom:={ODOMETRY_TOPIC}',
            '-p',
            'image_qos:=reliable',
        ]
    )
    try:
        yield process
    finally:
        process.terminate()
        process.wait(_SHUTDOWN_S)
