# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Opens a bag or an image folder as a dataset, with its ground truth, camera and odometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.datasets import bags
from hdc_place_recognition.datasets.arrays import FILE, open_arrays
from hdc_place_recognition.datasets.dataset import Dataset, Frames, GroundTruth, Mode
from hdc_place_recognition.datasets.folders import FolderImages, has_yaw, read_poses
from hdc_place_recognition.datasets.ground_truth import load_matrices, MatrixTruth, PoseTruth
from hdc_place_recognition.datasets.poses import Poses
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params, Value
from hdc_place_recognition.recognition.frame_filter import nanoseconds
from hdc_place_recognition.recognition.keyframes import no_odometry, Odometry


@dataclass(frozen=True)
class Options:
    """
    Options for opening a dataset.

    :param topic: image topic, None for the only image topic of the bag.
    :param ground_truth_topic: pose topic for ground truth, None for none.
    :param ground_truth_frames: 'PARENT:CHILD', frames of its transforms; None for the only pair.
    :param radius_m: images within this distance show the same place, if the angle allows it.
    :param max_angle_deg: largest angle between the viewing directions of the same place.
    :param view_axis: body axis that points forward; None for x in bags and in poses.csv with yaw,
        and z in poses.csv with quaternions.
    :param pose_tolerance_s: largest time difference between an image and its pose.
    :param camera_info_topic: CameraInfo topic, None for no camera.
    :param odom_topic: pose topic for keyframe selection, None for no odometry.
    :param odom_frames: 'PARENT:CHILD', frames of its transforms; None for the only pair.
    :param image_rectified: True if the images are rectified.
    :param skip_bad: skip messages without a valid image and images whose stamp does not
        increase, instead of raising an error.
    :param exif_orientation: turn the images of folders by their EXIF orientation.
    :param max_image_pixels: images of more pixels are refused.
    :raises PlaceRecognitionError: the radius or the angle is not positive.
    """

    topic: str | None = None
    ground_truth_topic: str | None = None
    ground_truth_frames: str | None = None
    radius_m: float = 5.0
    max_angle_deg: float = 45.0
    view_axis: str | None = None
    pose_tolerance_s: float = Params.odom_tolerance_s
    camera_info_topic: str | None = None
    odom_topic: str | None = None
    odom_frames: str | None = None
    image_rectified: bool = Params.image_rectified
    skip_bad: bool = False
    exif_orientation: bool = True
    max_image_pixels: int = Params.max_image_pixels

    def __post_init__(self) -> None:
        for flag, value in (('--radius', self.radius_m), ('--max-angle', self.max_angle_deg)):
            if not value > 0:
                raise PlaceRecognitionError(f'{flag} {value:g}: must be above 0')


DEFAULT_OPTIONS = Options()
# The images of a folder are already selected, so every image is stored and the metrics are exact
# over all pairs. Their stamps are one second apart: a gap of n images is a gap of n seconds. A bag
# is processed with the parameters of the node.
_ALL_IMAGES: Mapping[str, Value] = {
    'min_interval_s': 0.0,
    'keyframe_similarity': 1.0,
    'exact': True,
}


@dataclass(frozen=True)
class _Source:
    """The images of one traverse with their poses, camera and odometry."""

    frames: Frames
    poses: Poses | None
    view_axis: str
    overrides: Mapping[str, Value]
    camera: Camera | None = None
    odometry: Odometry = no_odometry


def open_dataset(
    path: Path, database: Path | None = None, options: Options = DEFAULT_OPTIONS
) -> Dataset:
    """
    Open a bag or an image folder as a dataset.

    :param path: a bag, or a folder with images/ (or images/ref and images/query) or frames.npz.
    :param database: bag or folder of an earlier traverse that `path` is compared with; None to
        find loops within `path`.
    :param options: topics and ground-truth limits.
    :return: the dataset; the mode depends on the content of the folder.
    :raises PlaceRecognitionError: a file is missing or damaged, or files do not fit together.
    """
    name = path.resolve().name if path.is_dir() else path.stem
    if database is not None:
        return _traverses(name, _open(path, options), _open(database, options), path, options)
    if (path / 'images' / 'query').is_dir():
        query, reference = (
            _Source(_folder(path / 'images' / part, options), None, 'z', _ALL_IMAGES)
            for part in ('query', 'ref')
        )
        return _traverses(name, query, reference, path, options)
    if (path / FILE).is_file():
        return open_arrays(name, path / FILE)
    return _single(name, _open(path, options), path, options)


def _single(name: str, source: _Source, path: Path, options: Options) -> Dataset:
    """Return a sequence, or a retrieval dataset if min_gap in gt.npz is negative."""
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
    """Return two traverses; gt.npz is read from the folder of the queries."""
    if options.odom_topic is not None:
        raise PlaceRecognitionError(
            f'--odom-topic {options.odom_topic}: two traverses have no common odometry; remove '
            'this option'
        )
    matrices = _matrices(path, query.frames, reference.frames)
    truth = matrices[0] if matrices else _pose_truth(query, reference, options)
    return Dataset(
        name, Mode.TRAVERSES, query.frames, reference.frames, truth, query.overrides, query.camera
    )


def _open(path: Path, options: Options) -> _Source:
    """Open the images and poses of one bag or folder."""
    if (path / 'images').is_dir():
        frames = _folder(path / 'images', options)
        file = path / 'poses.csv'
        poses = read_poses(file) if file.exists() else None
        axis = 'x' if poses and has_yaw(file) else 'z'
        return _Source(frames, poses, options.view_axis or axis, _ALL_IMAGES)
    if not path.exists():
        raise PlaceRecognitionError(f'{path} does not exist; give a bag or a folder of images')
    if path.is_dir() and not (path / 'metadata.yaml').exists():
        raise PlaceRecognitionError(
            f'{path} is neither a folder of images (it has no images/) nor a bag (it has no '
            'metadata.yaml; `ros2 bag reindex` creates it)'
        )
    images = bags.BagImages.from_bag(
        path, options.topic, options.skip_bad, options.max_image_pixels
    )
    poses = None
    if options.ground_truth_topic:
        poses = bags.read_poses(
            path, options.ground_truth_topic, frames=options.ground_truth_frames
        )
    return _Source(
        images,
        poses,
        options.view_axis or 'x',
        {},
        _camera(path, options),
        _odometry(path, options),
    )


def _folder(folder: Path, options: Options) -> FolderImages:
    return FolderImages.from_folder(
        folder, options.max_image_pixels, oriented=options.exif_orientation
    )


def _camera(path: Path, options: Options) -> Camera | None:
    """Return the camera of a bag, None if no topic is given."""
    if options.camera_info_topic is None:
        return None
    return bags.read_camera(path, options.camera_info_topic, rectified=options.image_rectified)


def _odometry(path: Path, options: Options) -> Odometry:
    """Return the odometry of a bag, or `no_odometry` if no topic is given."""
    if options.odom_topic is None:
        return no_odometry
    poses = bags.read_poses(path, options.odom_topic, '--odom-topic', options.odom_frames)
    return partial(poses.before, tolerance_ns=nanoseconds(options.pose_tolerance_s))


def _matrices(path: Path, queries: Frames, database: Frames) -> tuple[MatrixTruth, int] | None:
    """Read gt.npz of a folder; return the truth and min_gap, None if there is no such file."""
    file = path / 'gt.npz'
    if not (
        file.exists() and isinstance(queries, FolderImages) and isinstance(database, FolderImages)
    ):
        return None
    matrices, min_gap = load_matrices(file, len(queries), len(database))
    return MatrixTruth(matrices, queries.stamps_ns, database.stamps_ns), min_gap


def _pose_truth(query: _Source, reference: _Source, options: Options) -> GroundTruth | None:
    """Return ground truth from poses, None if a traverse has no poses."""
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
