# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""How inputs are to be read."""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.params.table import Params


@dataclass(frozen=True)
class Options:
    """
    How inputs are to be read.

    :param topic: image topic, None for the bag's only one.
    :param ground_truth_topic: of poses, None for no ground truth from the bag.
    :param radius_m: images nearer than this show the same place.
    :param max_angle_deg: if their directions of view differ by no more than this.
    :param view_axis: axis of the body that looks ahead; None for x in bags, z in poses.csv.
    :param pose_tolerance_s: greatest time between an image and its pose.
    :param camera_info_topic: of the calibration, None if it does not matter.
    :param odom_topic: that tells how far the robot has moved, None if it does not matter.
    :param image_rectified: whether the images are rectified.
    :param skip_bad: go on after messages that hold no image or whose stamp does not rise.
    """

    topic: str | None = None
    ground_truth_topic: str | None = None
    radius_m: float = 5.0
    max_angle_deg: float = 45.0
    view_axis: str | None = None
    pose_tolerance_s: float = Params.odom_tolerance_s
    camera_info_topic: str | None = None
    odom_topic: str | None = None
    image_rectified: bool = Params.image_rectified
    skip_bad: bool = False
