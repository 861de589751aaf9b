# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
The one table of parameters.

ROS declarations, `ros2 param set`, YAML files, command-line flags and the table in doc/ are all
generated from the fields of :class:`Params`; no default is written anywhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, Field, field, fields, replace
import math
from typing import Any, TypeVar

from hdc_place_recognition.errors import PlaceRecognitionError

Value = bool | int | float | str
Default = TypeVar('Default', bool, int, float, str)


@dataclass(frozen=True)
class Spec:
    """What is known of a parameter besides its name, default and type."""

    doc: str
    unit: str = ''
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    odd: bool = False
    live: bool = False

    def allowed(self) -> str:
        """Return the range or the choices in words, '' if anything of the type will do."""
        if self.choices:
            return ', '.join(self.choices)
        odd = ', odd' if self.odd else ''
        return '' if self.low is None else f'{self.low:g} to {self.high:g}{odd}'


def param(default: Default, doc: str, **details: Any) -> Default:
    """Return a field of the table; the details are those of :class:`Spec`."""
    parameter: Default = field(default=default, metadata={'spec': Spec(doc, **details)})
    return parameter


def spec(item: Field[Any]) -> Spec:
    """Return what the table says of one field of :class:`Params`."""
    found: Spec = item.metadata['spec']
    return found


def coerce(item: Field[Any], value: object) -> object:
    """Return `value`, as a float where an integer stands for one (ROS users type 1 for 1.0)."""
    if type(item.default) is float and type(value) is int:
        return float(value)
    return value


def check(item: Field[Any], value: object) -> None:
    """Raise the error that names parameter, value and remedy, if there is one."""
    kind, allowed = type(item.default), spec(item).allowed()
    of_range = f' ({allowed})' if allowed else ''
    if type(value) is not kind:
        raise PlaceRecognitionError(
            f'parameter {item.name}: {value!r} is a {type(value).__name__}, '
            f'expected a {kind.__name__}{of_range}'
        )
    if not _within(spec(item), value):
        raise PlaceRecognitionError(
            f'parameter {item.name}: {value!r} is not one of {allowed}'
            if spec(item).choices
            else f'parameter {item.name}: {value!r} is outside {allowed}'
        )


def _within(limits: Spec, value: object) -> bool:
    if limits.choices:
        return value in limits.choices
    if limits.low is None or limits.high is None or not isinstance(value, int | float):
        return True
    if limits.odd and value % 2 == 0:
        return False
    return math.isfinite(value) and limits.low <= value <= limits.high


@dataclass(frozen=True)
class Params:
    """Every parameter: name, default, and in its :class:`Spec` the rest."""

    # What is seen in an image.
    extractor: str = param(
        'efficientnet_lite0',
        'Local features that are bundled.',
        choices=('efficientnet_lite0', 'sift', 'rootsift', 'orb', 'gradient_grid'),
    )
    image_width: int = param(
        320,
        'Larger images are reduced to this width before extraction.',
        unit='px',
        low=32,
        high=4096,
    )
    max_features: int = param(
        300,
        'Strongest keypoints kept by sift, rootsift and orb; grids keep every cell.',
        low=1,
        high=10000,
    )

    # How it becomes one hypervector.
    dimensions: int = param(4096, 'Length d of the hypervectors.', low=64, high=65536)
    n_x: int = param(
        8,
        'Horizontal subintervals of the position encoding; fewer tolerate more sideways shift.',
        low=1,
        high=64,
    )
    n_y: int = param(6, 'Vertical subintervals of the position encoding.', low=1, high=64)
    preprocessing: str = param(
        'standardize',
        'Descriptors of an image: unit length, then centerd (l2_center) or also '
        'scaled to unit deviation in each dimension (standardize).',
        choices=('l2_center', 'standardize'),
    )
    projection: str = param(
        'orthogonal',
        'Random projection to hypervectors: gaussian, or the same with orthonormal columns.',
        choices=('gaussian', 'orthogonal'),
    )
    displacements_x: int = param(
        5,
        'Horizontal shifts of an image under which it is compared; 1: not shifted.',
        low=1,
        high=15,
        odd=True,
    )
    displacements_y: int = param(5, 'Vertical shifts; 1: not shifted.', low=1, high=15, odd=True)
    displacement_step: float = param(
        0.1,
        'Distance from one shift to the next, as a share of width or height.',
        low=0.0,
        high=0.5,
    )
    sequence_length: int = param(
        1, 'Images, the current and those before it, bundled into one descriptor.', low=1, high=100
    )
    seed: int = param(
        0,
        'Seed of all random vectors; robots that share a database need the same.',
        low=0,
        high=2**31 - 1,
    )

    # What it is compared with, and what counts as found.
    center_database: bool = param(
        True, 'Subtract the running mean of the images seen so far before comparing.'
    )
    exact: bool = param(
        False,
        'Compare with every image however many they are, rather than in large databases only '
        'with those that the signs of the hypervectors put first.',
        live=True,
    )
    max_keyframes: int = param(
        0,
        'Images kept in the database; of more the most redundant one is forgotten. 0 for no '
        'limit.',
        low=0,
        high=100000000,
    )
    max_database_mb: float = param(
        0.0,
        'Memory that the database may take, keypoints included; in a full one the most redundant '
        'images are forgotten. 0 for no limit.',
        unit='MB',
        low=0.0,
        high=1e6,
    )
    row_type: str = param(
        'float32',
        'Elements of the vectors in the database: float16 takes half the room, and compares '
        'small databases more slowly.',
        choices=('float32', 'float16'),
    )
    rows_folder: str = param(
        '',
        'Folder on a disk where the vectors of the database are kept, in a file that is gone '
        'when the program ends; empty to keep them in memory.',
    )
    min_interval_s: float = param(
        0.2,
        'Images nearer than this to the last one processed, by stamp, are passed over.',
        unit='s',
        low=0.0,
        high=3600.0,
        live=True,
    )
    exclude_recent_s: float = param(
        15.0,
        'Images younger than this are not candidates; time standing still does not count.',
        unit='s',
        low=0.0,
        high=86400.0,
        live=True,
    )
    exclude_recent_frames: int = param(
        0,
        'This many newest images of the database are not candidates either.',
        low=0,
        high=1000000,
        live=True,
    )
    top_k: int = param(10, 'Candidates reported for each image.', low=1, high=1000, live=True)
    verify: bool = param(True, 'Check candidates by the geometry of keypoints.')
    verify_features: int = param(
        300,
        'Keypoints kept of each image to verify it by, 134 bytes each.',
        low=8,
        high=10000,
    )
    verify_top_k: int = param(
        5, 'Candidates of each image that are verified.', low=1, high=100, live=True
    )
    min_score: float = param(
        0.95,
        'Probability from which a candidate is accepted as a loop closure.',
        low=0.0,
        high=1.0,
        live=True,
    )
    keyframe_similarity: float = param(
        0.9,
        'Images whose cosine similarity to the last keyframe is above this are compared but not '
        'stored: the robot stands still. 1 stores all.',
        low=0.0,
        high=1.0,
        live=True,
    )
    keyframe_distance_m: float = param(
        0.0,
        'With odometry: images taken nearer than this to the last keyframe, and turned by less '
        'than keyframe_angle_deg, are compared but not stored. 0: odometry does not matter.',
        unit='m',
        low=0.0,
        high=100.0,
        live=True,
    )
    keyframe_angle_deg: float = param(
        5.0, 'See keyframe_distance_m.', unit='deg', low=0.0, high=180.0, live=True
    )

    # How the node is wired.
    image_transport: str = param(
        'raw',
        'Type of the image topic: raw is sensor_msgs/Image, compressed is '
        'sensor_msgs/CompressedImage.',
        choices=('raw', 'compressed'),
    )
    image_qos: str = param(
        'sensor_data',
        'QoS of the image subscription: sensor_data is best effort, reliable '
        'loses nothing but needs a reliable publisher.',
        choices=('sensor_data', 'reliable'),
    )
    image_rectified: bool = param(
        False, 'The images are rectified: P of camera_info describes them, rather than K and D.'
    )
    odom_tolerance_s: float = param(
        0.1,
        'Odometry further from an image than this, by stamp, gives it no position.',
        unit='s',
        low=0.0,
        high=60.0,
        live=True,
    )
    threads: int = param(
        2,
        'Of two and more CPU threads, half find the keypoints that candidates are verified by, '
        'while the other half, of numpy, OpenCV and the network, do everything else.',
        low=1,
        high=256,
    )

    def __post_init__(self) -> None:
        for item in fields(self):
            check(item, getattr(self, item.name))

    @classmethod
    def from_dict(cls, values: Mapping[str, object]) -> Params:
        """
        Return the defaults changed by `values`.

        :raises PlaceRecognitionError: unknown name, wrong type, out of range.
        """
        return cls().replace(**values)

    def replace(self, **changes: Any) -> Params:
        """
        Return these parameters with some changed; an integer serves for a float.

        :raises PlaceRecognitionError: unknown name, wrong type, out of range.
        """
        known = {item.name: item for item in fields(self)}
        unknown = sorted(set(changes) - set(known))
        if unknown:
            raise PlaceRecognitionError(
                f'unknown parameter {", ".join(unknown)}; `hdc_params --markdown` lists all'
            )
        coerced: dict[str, Any] = {
            name: coerce(known[name], value) for name, value in changes.items()
        }
        return replace(self, **coerced)
