# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
The table of parameters.

ROS declarations, YAML files, command-line flags and the Markdown table are generated from the
fields of :class:`Params`. Defaults, ranges and descriptions are written only here.
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
    """
    Properties of a parameter besides its name, default and type.

    :param doc: description, one or more sentences.
    :param unit: unit, '' if there is none.
    :param low: smallest allowed value, None for no limit.
    :param high: largest allowed value, None for no limit.
    :param choices: allowed values, empty for any value.
    :param odd: True if only odd values are allowed.
    :param live: True if the parameter can change while the node runs.
    """

    doc: str
    unit: str = ''
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    odd: bool = False
    live: bool = False

    def allowed(self) -> str:
        """Return the range or the choices as text, '' if every value of the type is allowed."""
        if self.choices:
            return ', '.join(self.choices)
        odd = ', odd' if self.odd else ''
        return '' if self.low is None else f'{self.low:g} to {self.high:g}{odd}'


def param(default: Default, doc: str, **details: Any) -> Default:
    """Return a dataclass field with a :class:`Spec`; `details` are its other arguments."""
    parameter: Default = field(default=default, metadata={'spec': Spec(doc, **details)})
    return parameter


def spec(item: Field[Any]) -> Spec:
    """Return the :class:`Spec` of a field of :class:`Params`."""
    found: Spec = item.metadata['spec']
    return found


def coerce(item: Field[Any], value: object) -> object:
    """Return `value`; an integer for a float parameter is converted, as in `min_score:=1`."""
    if type(item.default) is float and type(value) is int:
        return float(value)
    return value


def check(item: Field[Any], value: object) -> None:
    """
    Check the type and the range of a value.

    :raises PlaceRecognitionError: the value is not allowed; the message has name, value and range.
    """
    kind, allowed = type(item.default), spec(item).allowed()
    range_text = f' ({allowed})' if allowed else ''
    if type(value) is not kind:
        raise PlaceRecognitionError(
            f'parameter {item.name}: {value!r} is a {type(value).__name__}, '
            f'expected a {kind.__name__}{range_text}'
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
    """All parameters with their defaults; the :class:`Spec` of a field has the rest."""

    # Local features.
    extractor: str = param(
        'efficientnet_lite0',
        'Type of local features.',
        choices=('efficientnet_lite0', 'sift', 'rootsift', 'orb', 'gradient_grid'),
    )
    image_width: int = param(
        320,
        'Larger images are resized to this width before feature extraction.',
        unit='px',
        low=32,
        high=4096,
    )
    max_features: int = param(
        300,
        'Maximum number of keypoints for sift, rootsift and orb; grid extractors use every cell.',
        low=1,
        high=10000,
    )

    # Image descriptor: one hypervector per image (Eq. 4 of the paper).
    dimensions: int = param(
        4096, 'Number of dimensions d of the hypervectors.', low=64, high=65536
    )
    n_x: int = param(
        8,
        'Number of horizontal intervals of the position encoding. Fewer intervals tolerate '
        'more horizontal shift.',
        low=1,
        high=64,
    )
    n_y: int = param(6, 'Number of vertical intervals of the position encoding.', low=1, high=64)
    preprocessing: str = param(
        'standardize',
        'Preprocessing of the local descriptors of an image: unit length and zero mean '
        '(l2_center), or also unit standard deviation in each dimension (standardize).',
        choices=('l2_center', 'standardize'),
    )
    projection: str = param(
        'orthogonal',
        'Random projection of local descriptors to hypervectors: gaussian, or orthogonal '
        '(gaussian with orthonormal columns).',
        choices=('gaussian', 'orthogonal'),
    )
    displacements_x: int = param(
        5,
        'Number of horizontal shifts at which two images are compared; 1 compares without shift.',
        low=1,
        high=15,
        odd=True,
    )
    displacements_y: int = param(
        5,
        'Number of vertical shifts at which two images are compared; 1 compares without shift.',
        low=1,
        high=15,
        odd=True,
    )
    displacement_step: float = param(
        0.1,
        'Distance between two shifts, as a fraction of the image width or height.',
        low=0.0,
        high=0.5,
    )
    sequence_length: int = param(
        1, 'Number of consecutive images that are bundled into one descriptor.', low=1, high=100
    )
    seed: int = param(
        0,
        'Seed of all random vectors. Robots that share a database need the same seed.',
        low=0,
        high=2**31 - 1,
    )

    # Database, candidates and verification.
    center_database: bool = param(
        True, 'Subtract the running mean of the image descriptors before comparison.'
    )
    exact: bool = param(
        False,
        'Compute the similarity to every image. Otherwise a large database is searched in '
        'two steps: the signs of the hypervectors select images, and only these are '
        'compared exactly.',
        live=True,
    )
    max_keyframes: int = param(
        0,
        'Maximum number of keyframes in the database. The most redundant keyframe is '
        'evicted when the limit is exceeded. 0 means no limit.',
        low=0,
        high=100000000,
    )
    max_database_mb: float = param(
        0.0,
        'Maximum memory of the database, keypoints included. The most redundant keyframes '
        'are evicted when the limit is exceeded. 0 means no limit.',
        unit='MB',
        low=0.0,
        high=1e6,
    )
    row_type: str = param(
        'float32',
        'Number format of the hypervectors in the database. float16 needs half the memory; '
        'small databases are searched more slowly.',
        choices=('float32', 'float16'),
    )
    rows_folder: str = param(
        '',
        'Folder for the hypervectors of the database, stored in an anonymous temporary '
        'file; the OS deletes it on exit or crash. Empty keeps them in memory.',
    )
    min_interval_s: float = param(
        0.2,
        'Minimum time between processed images, by stamp. Images that come sooner are skipped.',
        unit='s',
        low=0.0,
        high=3600.0,
        live=True,
    )
    exclude_recent_s: float = param(
        15.0,
        'Minimum age of a candidate. Time during which the robot stands still is not counted; '
        'a gap between images or a jump of the clock counts as two images, or one second.',
        unit='s',
        low=0.0,
        high=86400.0,
        live=True,
    )
    exclude_recent_frames: int = param(
        0,
        'Number of newest keyframes that are not candidates.',
        low=0,
        high=1000000,
        live=True,
    )
    top_k: int = param(10, 'Number of candidates reported per image.', low=1, high=1000, live=True)
    verify: bool = param(True, 'Verify candidates by the geometry of matched keypoints.')
    verify_features: int = param(
        300,
        'Maximum number of keypoints stored per image for verification, 70 bytes each.',
        low=8,
        high=10000,
    )
    verify_top_k: int = param(
        5, 'Number of candidates verified per image.', low=1, high=100, live=True
    )
    min_score: float = param(
        0.95,
        'Probability threshold. Candidates with at least this score are accepted as loop '
        'closures.',
        low=0.0,
        high=1.0,
        live=True,
    )
    allow_appearance_closures: bool = param(
        True,
        'Accept loop closures with another traverse by the appearance of successive images alone, '
        'where no keypoints agree, as between seasons. Needs a network extractor.',
        live=True,
    )
    appearance_gap_s: float = param(
        3600.0,
        'Age from which keyframes of the same traverse count as another visit for '
        'allow_appearance_closures.',
        unit='s',
        low=0.0,
        high=1e9,
        live=True,
    )
    keyframe_similarity: float = param(
        0.9,
        'An image is not stored if its cosine similarity to the last keyframe is higher '
        'than this, because the robot stands still. It is still compared. 1 stores all '
        'images.',
        low=0.0,
        high=1.0,
        live=True,
    )
    keyframe_distance_m: float = param(
        0.0,
        'With odometry: an image is not stored if it is closer than this to the last '
        'keyframe and rotated by less than keyframe_angle_deg. It is still compared. 0 '
        'ignores odometry.',
        unit='m',
        low=0.0,
        high=100.0,
        live=True,
    )
    keyframe_angle_deg: float = param(
        5.0,
        'Minimum rotation of a new keyframe, see keyframe_distance_m.',
        unit='deg',
        low=0.0,
        high=180.0,
        live=True,
    )

    # Node.
    image_transport: str = param(
        'raw',
        'Type of the image topic: sensor_msgs/Image (raw) or sensor_msgs/CompressedImage '
        '(compressed); /compressed is appended to the name of the topic then.',
        choices=('raw', 'compressed'),
    )
    image_qos: str = param(
        'auto',
        'QoS of the image subscription: that of the publishers (auto: reliable if all of them '
        'are), best effort (sensor_data), or reliable, which needs reliable publishers.',
        choices=('auto', 'sensor_data', 'reliable'),
    )
    max_image_pixels: int = param(
        50_000_000,
        'Images of more pixels are refused, compressed images by their header. This bounds the '
        'memory that a damaged or hostile image takes.',
        unit='px',
        low=1,
        high=1_000_000_000,
    )
    image_rectified: bool = param(
        False,
        'True if the images are rectified. The matrix P of camera_info is used then, '
        'otherwise K and D.',
    )
    odom_tolerance_s: float = param(
        0.1,
        'Maximum time between an image and the odometry message that gives its position, by '
        'stamp.',
        unit='s',
        low=0.0,
        high=60.0,
        live=True,
    )
    threads: int = param(
        2,
        'CPU threads. With two or more, half extract verification keypoints in parallel '
        'with everything else.',
        low=1,
        high=256,
    )

    def __post_init__(self) -> None:
        for item in fields(self):
            check(item, getattr(self, item.name))

    @classmethod
    def from_dict(cls, values: Mapping[str, object]) -> Params:
        """
        Return the defaults with the given values.

        :raises PlaceRecognitionError: unknown name, wrong type or out of range.
        """
        return cls().replace(**values)

    def replace(self, **changes: Any) -> Params:
        """
        Return a copy with changed values; an integer is accepted for a float.

        :raises PlaceRecognitionError: unknown name, wrong type or out of range.
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
