# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""How inputs are to be read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.datasets import bags, folders
from hdc_place_recognition.datasets.dataset import Dataset, Frames, GroundTruth, Mode
from hdc_place_recognition.datasets.ground_truth import load_matrices, MatrixTruth, PoseTruth
from hdc_place_recognition.datasets.poses import Poses
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params, Value
from hdc_place_recognition.recognition.frame_filter import nanoseconds
from hdc_place_recognition.recognition.keyframes import no_odometry, Odometry


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


# Images of a folder are one second apart, and seconds are images. All of them count: whoever made
# the folder has selected them, and the metrics are about all pairs, exactly. A bag instead is
# searched as the node does it.
_ALL_IMAGES: Mapping[str, Value] = {
    'min_interval_s': 0.0,
    'keyframe_similarity': 1.0,
    'exact': True,
}


@dataclass(frozen=True)
class _Source:
    """One traverse: its images, and what else is known."""

    frames: Frames
    poses: Poses | None
    view_axis: str
    overrides: Mapping[str, Value]
    camera: Camera | None = None
    odometry: Odometry = no_odometry


def open_dataset(path: Path, database: Path | None, options: Options) -> Dataset:
    """
    Open one input.

    :param path: a bag, or a folder with images/ (or images/ref and images/query).
    :param database: another one that `path` is compared with, None to find loops within `path`.
    :param options: how to read them.
    :return: the data set; its mode follows from what is there.
    :raises PlaceRecognitionError: something is missing, damaged, or does not fit together.
    """
    name = path.resolve().name if path.is_dir() else path.stem
    if database is not None:
        return _traverses(name, _open(path, options), _open(database, options), path, options)
    if (path / 'images' / 'query').is_dir():
        query, reference = (
            _Source(
                folders.FolderImages.from_folder(path / 'images' / part), None, 'z', _ALL_IMAGES
            )
            for part in ('query', 'ref')
        )
        return _traverses(name, query, reference, path, options)
    return _single(name, _open(path, options), path, options)


def _single(name: str, source: _Source, path: Path, options: Options) -> Dataset:
    """Return one sequence, or a set for retrieval if its ground truth says so."""
    matrices = _matrices(path, source.frames, source.frames)
    if matrices is None:
        truth = _pose_truth(source, source, options)
        return Dataset(
            name,
            Mode.SEQUENCE,
            source.frames,
            ground_truth=truth,
            overrides=source.overrides,
            camera=source.camera,
            odometry=source.odometry,
        )
    truth, min_gap = matrices
    if min_gap < 0:
        return Dataset(name, Mode.RETRIEVAL, source.frames, None, truth, source.overrides)
    gap = {'exclude_recent_s': float(min_gap), 'exclude_recent_frames': 0}
    return Dataset(name, Mode.SEQUENCE, source.frames, None, truth, {**source.overrides, **gap})


def _traverses(
    name: str, query: _Source, reference: _Source, path: Path, options: Options
) -> Dataset:
    """Return two traverses; a ground-truth file is that of the queries' folder."""
    if options.odom_topic is not None:
        raise PlaceRecognitionError(
            f'--odom-topic {options.odom_topic}: two traverses have no common odometry; leave it '
            'out'
        )
    matrices = _matrices(path, query.frames, reference.frames)
    truth = matrices[0] if matrices else _pose_truth(query, reference, options)
    return Dataset(
        name, Mode.TRAVERSES, query.frames, reference.frames, truth, query.overrides, query.camera
    )


def _open(path: Path, options: Options) -> _Source:
    """Return the images and poses of one bag or folder."""
    if (path / 'images').is_dir():
        frames = folders.FolderImages.from_folder(path / 'images')
        file = path / 'poses.csv'
        poses = folders.read_poses(file) if file.exists() else None
        return _Source(frames, poses, options.view_axis or 'z', _ALL_IMAGES)
    if not path.exists():
        raise PlaceRecognitionError(f'{path} does not exist; give a bag or a folder of images')
    if path.is_dir() and not (path / 'metadata.yaml').exists():
        raise PlaceRecognitionError(
            f'{path} is neither a folder of images (it has no images/) nor a bag (it has no '
            'metadata.yaml; `ros2 bag reindex` makes one)'
        )
    images = bags.BagImages.from_bag(path, options.topic, options.skip_bad)
    poses = (
        bags.read_poses(path, options.ground_truth_topic) if options.ground_truth_topic else None
    )
    return _Source(
        images,
        poses,
        options.view_axis or 'x',
        {},
        _camera(path, options),
        _odometry(path, options),
    )


def _camera(path: Path, options: Options) -> Camera | None:
    """Return the camera of a bag, if it was asked for."""
    if options.camera_info_topic is None:
        return None
    return bags.read_camera(path, options.camera_info_topic, rectified=options.image_rectified)


def _odometry(path: Path, options: Options) -> Odometry:
    """Return what tells of a bag where the robot was, if it was asked for."""
    if options.odom_topic is None:
        return no_odometry
    poses = bags.read_poses(path, options.odom_topic, '--odom-topic')
    return partial(poses.before, tolerance_ns=nanoseconds(options.pose_tolerance_s))


def _matrices(path: Path, queries: Frames, database: Frames) -> tuple[MatrixTruth, int] | None:
    """Return what the ground-truth file of a folder says, and its min_gap; None if none is."""
    file = path / 'gt.npz'
    if not (
        file.exists()
        and isinstance(queries, folders.FolderImages)
        and isinstance(database, folders.FolderImages)
    ):
        return None
    whole, min_gap = load_matrices(file, len(queries), len(database))
    return MatrixTruth(whole, queries.stamps_ns, database.stamps_ns), min_gap


def _pose_truth(query: _Source, reference: _Source, options: Options) -> GroundTruth | None:
    if query.poses is None or reference.poses is None:
        return None
    return PoseTruth(
        queries=query.poses,
        database=reference.poses,
        radius_m=options.radius_m,
        max_angle_deg=options.max_angle_deg,
        view_axis=query.view_axis,
        tolerance_ns=nanoseconds(options.pose_tolerance_s),
    )
