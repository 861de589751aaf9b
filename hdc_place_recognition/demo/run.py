# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command hdc_demo: a loop driven twice, through the real node."""

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
from hdc_place_recognition.demo.bag import (
    CAMERA_INFO_TOPIC,
    IMAGE_TOPIC,
    ODOMETRY_TOPIC,
    write_bag,
)
from hdc_place_recognition.demo.play import Player, raw_messages
from hdc_place_recognition.demo.score import score
from hdc_place_recognition.evaluation.metrics import Closures
from hdc_place_recognition.params.formats import NODE_NAME
import rclpy

GOOD_RECALL = 0.9
_SHUTDOWN_S = 10.0


def main(argv: Sequence[str] | None = None) -> int:
    """Render the drive, play it through the node and report; 1 if closures are wrong or few."""
    parser = argparse.ArgumentParser(prog='hdc_demo', description=__doc__)
    parser.add_argument(
        '--bag',
        type=Path,
        default=Path('demo_bag'),
        help='where the bag is kept; rendered if it is not there [%(default)s]',
    )
    parser.add_argument('--render-only', action='store_true', help='only write the bag')
    arguments = parser.parse_args(argv)

    def work() -> int:
        render(arguments.bag)
        return 0 if arguments.render_only else run(arguments.bag)

    return run_command('hdc_demo', work)


def render(bag: Path) -> None:
    """Write the bag unless it is there; it appears whole or not at all."""
    if bag.exists():
        return
    print(f'rendering a drive round the block, and round it again -> {bag}', flush=True)
    scratch = bag.with_name(bag.name + '.unfinished')
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir(parents=True)
    # Under its own name already: the files in a bag are called after it.
    write_bag(scratch / bag.name)
    (scratch / bag.name).rename(bag)
    scratch.rmdir()


def run(bag: Path) -> int:
    """Play the bag through the node; return the exit code."""
    # ROS from PyPI finds its parts by this; a sourced ROS 2 has set it.
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
    """Print how the closures compare with the odometry; return the exit code."""
    precision, recall = closures.precision or 0.0, closures.recall or 0.0
    print(
        f'closures: {closures.true} true, {closures.false} false, {closures.ignored} between; '
        f'images at a place seen before: {closures.queries_with_match}, '
        f'recognised: {closures.queries_found}'
    )
    print(f'precision {precision:.3f}  recall {recall:.3f}')
    return 0 if precision == 1 and recall >= GOOD_RECALL else 1


@contextmanager
def node_process() -> Iterator[subprocess.Popen[bytes]]:
    """Run the node as a robot would, beside this process."""
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
