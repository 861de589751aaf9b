# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Holds the closures against the odometry."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hdc_place_recognition.datasets.bags import read_poses
from hdc_place_recognition.datasets.ground_truth import PoseTruth
from hdc_place_recognition.datasets.open_dataset import Options
from hdc_place_recognition.evaluation.metrics import Closures, count_closures
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.frame_filter import nanoseconds
from hdc_place_recognition.results import Candidate
import numpy as np


def score(
    bag: Path, odometry_topic: str, answered_ns: Sequence[int], closures: Sequence[Candidate]
) -> Closures:
    """
    Count right and wrong closures, by the rules of hdc_evaluate with its default radius and angle.

    :param answered_ns: stamps of all images that the node answered, rising.
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
