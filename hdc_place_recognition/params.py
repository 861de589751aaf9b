# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
The one table of parameters.

ROS declarations, `ros2 param set`, YAML files, command-line flags and README's table are all made
from the fields of :class:`Params`; no default is written anywhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, Field, field, fields, replace
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
    live: bool = False

    def allowed(self) -> str:
        """Return the range or the choices in words, '' if anything of the type will do."""
        if self.choices:
            return ', '.join(self.choices)
        return '' if self.low is None else f'{self.low:g} to {self.high:g}'


def _param(default: Default, doc: str, **details: Any) -> Default:
    parameter: Default = field(default=default, metadata={'spec': Spec(doc, **details)})
    return parameter


@dataclass(frozen=True)
class Params:
    """Every parameter: name, default, and in its :class:`Spec` the rest."""

    # What is seen in an image.
    extractor: str = _param(
        'efficientnet_lite0',
        'Local features that are bundled.',
        choices=('efficientnet_lite0', 'sift', 'rootsift', 'orb', 'gradient_grid'),
    )
    image_width: int = _param(
        320,
        'Larger images are reduced to this width before extraction.',
        unit='px',
        low=32,
        high=4096,
    )
    max_features: int = _param(
        300,
        'Strongest keypoints kept by sift, rootsift and orb; grids keep every cell.',
        low=1,
        high=10000,
    )

    # How it becomes one hypervector.
    dimensions: int = _param(4096, 'Length d of the hypervectors.', low=64, high=65536)
    n_x: int = _param(
        8,
        'Horizontal subintervals of the position encoding; fewer tolerate more sideways shift.',
        low=1,
        high=64,
    )
    n_y: int = _param(6, 'Vertical subintervals of the position encoding.', low=1, high=64)
    preprocessing: str = _param(
        'standardize',
        'Descriptors of an image: unit length, then centred (l2_center) or also '
        'scaled to unit deviation in each dimension (standardize).',
        choices=('l2_center', 'standardize'),
    )
    projection: str = _param(
        'orthogonal',
        'Random projection to hypervectors: gaussian, or the same with orthonormal columns.',
        choices=('gaussian', 'orthogonal'),
    )
    displacements_x: int = _param(
        5,
        'Horizontal displacements, odd, under which an image is compared; 1 is none.',
        low=1,
        high=15,
    )
    displacements_y: int = _param(5, 'Vertical displacements, odd; 1 is none.', low=1, high=15)
    displacement_step: float = _param(
        0.1,
        'From one displacement to the next, as a share of the image.',
        low=0.0,
        high=0.5,
    )
    sequence_length: int = _param(
        1, 'Images, the current and those before it, bundled into one descriptor.', low=1, high=100
    )
    seed: int = _param(
        0,
        'Seed of all random vectors; robots that share a database need the same.',
        low=0,
        high=2**31 - 1,
    )

    # What it is compared with, and what counts as found.
    center_database: bool = _param(
        True, 'Subtract the running mean of the images seen so far before comparing.'
    )
    exact: bool = _param(
        False,
        'Compare with every image however many they are, rather than in large databases only '
        'with those that the signs of the hypervectors put first.',
        live=True,
    )
    max_keyframes: int = _param(
        0,
        'Images kept in the database; of more the most redundant one is forgotten. 0 for no '
        'limit.',
        low=0,
        high=100000000,
    )
    min_interval_s: float = _param(
        0.2,
        'Images nearer than this to the last one processed, by stamp, are passed over.',
        unit='s',
        low=0.0,
        high=3600.0,
        live=True,
    )
    exclude_recent_s: float = _param(
        15.0,
        'Images younger than this are not candidates; time standing still does not count.',
        unit='s',
        low=0.0,
        high=86400.0,
        live=True,
    )
    exclude_recent_frames: int = _param(
        0,
        'This many newest images of the database are not candidates either.',
        low=0,
        high=1000000,
        live=True,
    )
    top_k: int = _param(10, 'Candidates reported for each image.', low=1, high=1000, live=True)
    verify: bool = _param(True, 'Check candidates by the geometry of keypoints.')
    verify_features: int = _param(
        300,
        'Keypoints kept of each image to verify it by, 134 bytes each.',
        low=8,
        high=10000,
    )
    verify_top_k: int = _param(
        5, 'Candidates of each image that are verified.', low=1, high=100, live=True
    )
    min_score: float = _param(
        0.95,
        'Probability from which a candidate is accepted as a loop closure.',
        low=0.0,
        high=1.0,
        live=True,
    )
    keyframe_similarity: float = _param(
        0.9,
        'Images whose cosine similarity to the last keyframe is above this are compared but not '
        'stored: the robot stands still. 1 stores all.',
        low=0.0,
        high=1.0,
        live=True,
    )

    # How the node is wired.
    image_transport: str = _param(
        'raw',
        'Type of the image topic: raw is sensor_msgs/Image, compressed is '
        'sensor_msgs/CompressedImage.',
        choices=('raw', 'compressed'),
    )
    image_qos: str = _param(
        'sensor_data',
        'QoS of the image subscription: sensor_data is best effort, reliable '
        'loses nothing but needs a reliable publisher.',
        choices=('sensor_data', 'reliable'),
    )
    odom_tolerance_s: float = _param(
        0.1,
        'Odometry further from an image than this, by stamp, gives it no position.',
        unit='s',
        low=0.0,
        high=60.0,
        live=True,
    )
    threads: int = _param(1, 'CPU threads of numpy, OpenCV and the network.', low=1, high=256)

    def __post_init__(self) -> None:
        for item in fields(self):
            _check(item, getattr(self, item.name))

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
            name: _coerce(known[name], value) for name, value in changes.items()
        }
        return replace(self, **coerced)

    def to_dict(self) -> dict[str, Value]:
        """Return names and values in the table's order."""
        return asdict(self)


def spec(item: Field[Any]) -> Spec:
    """Return what the table says of one field of :class:`Params`."""
    found: Spec = item.metadata['spec']
    return found


def _coerce(item: Field[Any], value: object) -> object:
    """Return `value`, as a float where an integer stands for one (ROS users type 1 for 1.0)."""
    if type(item.default) is float and type(value) is int:
        return float(value)
    return value


def _check(item: Field[Any], value: object) -> None:
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
    return math.isfinite(value) and limits.low <= value <= limits.high
