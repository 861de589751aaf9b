# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command hdc_evaluate: evaluates bags and image folders."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import asdict
import json
from pathlib import Path
from typing import Any

from hdc_place_recognition.cli.run import run_command
from hdc_place_recognition.datasets.dataset import Frames
from hdc_place_recognition.datasets.open_dataset import Options
from hdc_place_recognition.datasets.poses import VIEW_AXES
from hdc_place_recognition.evaluation.evaluate import evaluate_input
from hdc_place_recognition.evaluation.plots import draw, require_matplotlib
from hdc_place_recognition.evaluation.progress import with_progress_bar
from hdc_place_recognition.evaluation.result_files import write_results
from hdc_place_recognition.evaluation.tables import summary, table
from hdc_place_recognition.params.formats import add_arguments, from_arguments
from hdc_place_recognition.results import Frame


def main(argv: Sequence[str] | None = None) -> int:
    """
    Evaluate inputs, print metrics and write results.

    :param argv: command-line arguments, by default those of the process.
    :return: exit code, 2 if an input or a parameter is invalid.
    """
    arguments = _parser().parse_args(argv)
    return run_command('hdc_evaluate', lambda: _run(arguments))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='hdc_evaluate',
        allow_abbrev=False,
        description='Run the recognizer on recorded images and compute metrics.',
        epilog='Without ground truth, closures are counted and metrics that need it are null.',
    )
    _add_inputs(parser)
    _add_ground_truth(parser.add_argument_group('ground truth, for inputs without gt.npz'))
    _add_results(parser.add_argument_group('results'))
    add_arguments(parser)
    return parser


def _add_inputs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        'inputs',
        nargs='+',
        type=Path,
        metavar='INPUT',
        help='rosbag (folder, .mcap, .db3, .bag) or folder with images/ and optionally gt.npz or '
        'poses.csv',
    )
    parser.add_argument(
        '--database',
        type=Path,
        metavar='BAG_OR_FOLDER',
        help='compare INPUT with this earlier traverse instead of with itself',
    )
    parser.add_argument('--topic', help='image topic, required if the bag has several')
    parser.add_argument(
        '--camera-info-topic',
        metavar='TOPIC',
        help='CameraInfo topic; accepted candidates then contain the camera rotation',
    )
    parser.add_argument(
        '--odom-topic',
        metavar='TOPIC',
        help='pose topic (as --ground-truth-topic), used by keyframe_distance_m',
    )
    parser.add_argument(
        '--odom-frames',
        metavar='PARENT:CHILD',
        help='frames of its transforms, required if it has several pairs',
    )
    parser.add_argument(
        '--no-exif-orientation',
        dest='exif_orientation',
        action='store_false',
        help='do not turn the images of folders by their EXIF orientation',
    )
    parser.add_argument(
        '--skip-bad',
        action='store_true',
        help='skip messages without a valid image and images whose stamp does not increase',
    )


def _add_ground_truth(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        '--ground-truth-topic',
        metavar='TOPIC',
        help='topic of type Odometry, PoseStamped, PoseWithCovarianceStamped, Path, '
        'TransformStamped, TFMessage or NavSatFix (with --max-angle 180)',
    )
    group.add_argument(
        '--ground-truth-frames',
        metavar='PARENT:CHILD',
        help='frames of its transforms, required if it has several pairs',
    )
    group.add_argument(
        '--radius',
        type=float,
        default=Options.radius_m,
        metavar='M',
        help='largest distance between poses of the same place [%(default)s]',
    )
    group.add_argument(
        '--max-angle',
        type=float,
        default=Options.max_angle_deg,
        metavar='DEG',
        help='largest angle between their viewing directions; 180 = any [%(default)s]',
    )
    group.add_argument(
        '--view-axis',
        choices=sorted(VIEW_AXES),
        help='body axis that points forward [z in poses.csv with quaternions, otherwise x]',
    )


def _add_results(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        '--output',
        type=Path,
        default=Path('results'),
        metavar='FOLDER',
        help='parent of the results folder <name>_<n>/ [%(default)s]',
    )
    group.add_argument(
        '--json', action='store_true', help='print only the content of metrics.json'
    )
    group.add_argument('--plot', action='store_true', help='write plots to the results folder')


def _run(arguments: argparse.Namespace) -> int:
    """Evaluate all inputs; return the exit code."""
    params = from_arguments(arguments)
    if arguments.plot:
        require_matplotlib()
    evaluations = []
    for path in arguments.inputs:
        evaluation = evaluate_input(path, **_options(arguments), **asdict(params))
        folder = write_results(evaluation, arguments.output)
        if arguments.plot:
            draw(evaluation, folder)
        if not arguments.json:
            print(f'{table(evaluation)}\n-> {folder}\n')
        evaluations.append(evaluation)
    if arguments.json:
        results = [evaluation.metrics for evaluation in evaluations]
        print(json.dumps(results if len(results) > 1 else results[0], indent=2))
    elif len(evaluations) > 1:
        print(summary(evaluations))
    return 0


def _options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the options of :func:`evaluate_input` that a command line sets."""
    return {
        'database': arguments.database,
        'topic': arguments.topic,
        'ground_truth_topic': arguments.ground_truth_topic,
        'ground_truth_frames': arguments.ground_truth_frames,
        'radius_m': arguments.radius,
        'max_angle_deg': arguments.max_angle,
        'view_axis': arguments.view_axis,
        'odom_topic': arguments.odom_topic,
        'odom_frames': arguments.odom_frames,
        'exif_orientation': arguments.exif_orientation,
        'camera_info_topic': arguments.camera_info_topic,
        'skip_bad': arguments.skip_bad,
        'progress': _progress,
    }


def _progress(frames: Frames, label: str) -> Iterable[Frame]:
    """Return the frames with a progress bar."""
    return with_progress_bar(frames, len(frames), label, 'image')
