# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The command hdc_evaluate."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
import logging
from pathlib import Path
import sys

from hdc_place_recognition.cli.run import run_command
from hdc_place_recognition.datasets.dataset import Dataset
from hdc_place_recognition.datasets.open_dataset import open_dataset, Options
from hdc_place_recognition.datasets.poses import VIEW_AXES
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.evaluate import evaluate, Evaluation, without_progress
from hdc_place_recognition.evaluation.plots import draw, require_matplotlib
from hdc_place_recognition.evaluation.replay import Progress
from hdc_place_recognition.evaluation.result_files import write_results
from hdc_place_recognition.evaluation.tables import metrics_dict, summary, table
from hdc_place_recognition.params.formats import add_arguments, from_arguments
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import create_recognizer

_log = logging.getLogger(__name__)


def main(argv: Sequence[str] | None = None) -> int:
    """
    Evaluate inputs, print their metrics and write their results.

    :param argv: arguments of the command line, those of the process by default.
    :return: exit code; 2 if the input or a parameter is bad.
    """
    arguments = _parser().parse_args(argv)
    return run_command('hdc_evaluate', lambda: _run(arguments))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='hdc_evaluate',
        allow_abbrev=False,
        description='Run the recognizer on recorded images and measure what it finds.',
        epilog='Without ground truth the closures are counted and the metrics are null.',
    )
    _add_inputs(parser)
    _add_ground_truth(parser.add_argument_group('ground truth, where there is no gt.npz'))
    _add_results(parser.add_argument_group('results'))
    add_arguments(parser)
    return parser


def _add_inputs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        'inputs',
        nargs='+',
        type=Path,
        metavar='INPUT',
        help='rosbag (folder, .mcap, .db3, .bag) or folder with images/ and perhaps gt.npz or '
        'poses.csv',
    )
    parser.add_argument(
        '--database',
        type=Path,
        metavar='BAG_OR_FOLDER',
        help='compare INPUT with this other traverse instead of with itself',
    )
    parser.add_argument('--topic', help='image topic, needed if a bag has several')
    parser.add_argument(
        '--camera-info-topic',
        metavar='TOPIC',
        help='CameraInfo in the bag: accepted candidates tell the rotation of the camera',
    )
    parser.add_argument(
        '--odom-topic',
        metavar='TOPIC',
        help='Odometry in the bag, for keyframe_distance_m',
    )
    parser.add_argument(
        '--skip-bad',
        action='store_true',
        help='go on after messages that hold no image or whose stamp does not rise',
    )


def _add_ground_truth(group: argparse._ArgumentGroup) -> None:
    defaults = Options()
    group.add_argument(
        '--ground-truth-topic', metavar='TOPIC', help='Odometry, PoseStamped or Path in the bag'
    )
    group.add_argument(
        '--radius',
        type=float,
        default=defaults.radius_m,
        metavar='M',
        help='poses nearer than this show the same place [%(default)s]',
    )
    group.add_argument(
        '--max-angle',
        type=float,
        default=defaults.max_angle_deg,
        metavar='DEG',
        help='if they look in directions no further apart than this; 180 = any [%(default)s]',
    )
    group.add_argument(
        '--view-axis',
        choices=sorted(VIEW_AXES),
        help='axis of the posed body that looks ahead [x in bags, z in poses.csv]',
    )


def _add_results(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        '--output',
        type=Path,
        default=Path('results'),
        metavar='FOLDER',
        help='where <name>_<n>/ with all results is made [%(default)s]',
    )
    group.add_argument('--json', action='store_true', help='print metrics.json and nothing else')
    group.add_argument('--plot', action='store_true', help='draw pictures into the results too')


def _run(arguments: argparse.Namespace) -> int:
    params = from_arguments(arguments)
    if arguments.plot:
        require_matplotlib()
    options = _options(arguments, params)
    evaluations = []
    for path in arguments.inputs:
        dataset = open_dataset(path, arguments.database, options)
        evaluation = _evaluate(dataset, params)
        folder = write_results(evaluation, arguments.output)
        if arguments.plot:
            draw(evaluation, folder)
        if not arguments.json:
            print(f'{table(evaluation)}\n-> {folder}\n')
        evaluations.append(evaluation)
    if arguments.json:
        results = [metrics_dict(evaluation) for evaluation in evaluations]
        print(json.dumps(results if len(results) > 1 else results[0], indent=2))
    elif len(evaluations) > 1:
        print(summary(evaluations))

    return 0


def _evaluate(dataset: Dataset, params: Params) -> Evaluation:
    recognizer = create_recognizer(params.replace(**dataset.overrides))
    _log.info('%s: local features are %s', dataset.name, recognizer.database.extractor)
    return evaluate(dataset, recognizer, _progress())


def _options(arguments: argparse.Namespace, params: Params) -> Options:
    for flag, value in (
        ('--radius', arguments.radius),
        ('--max-angle', arguments.max_angle),
    ):
        if not value > 0:
            raise PlaceRecognitionError(f'{flag} {value:g}: must be above 0')
    return Options(
        topic=arguments.topic,
        ground_truth_topic=arguments.ground_truth_topic,
        radius_m=arguments.radius,
        max_angle_deg=arguments.max_angle,
        view_axis=arguments.view_axis,
        pose_tolerance_s=params.odom_tolerance_s,
        odom_topic=arguments.odom_topic,
        camera_info_topic=arguments.camera_info_topic,
        image_rectified=params.image_rectified,
        skip_bad=arguments.skip_bad,
    )


def _progress() -> Progress:
    """Return what shows a bar on a terminal that can show one, and else does nothing."""
    if not sys.stderr.isatty():
        return without_progress
    try:
        from tqdm import tqdm
    except ImportError:
        return without_progress
    return lambda frames, label: tqdm(frames, total=len(frames), desc=label, unit='image')
