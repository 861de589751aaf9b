# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Any message is an image or one error: raw and compressed images, cameras and poses."""

from types import SimpleNamespace as Fields

import cv2
from hdc_place_recognition.conversions.camera_info import camera_from_message
from hdc_place_recognition.conversions.image import ImageConverter, SUPPORTED_ENCODINGS
from hdc_place_recognition.conversions.poses import PoseConverter
from hdc_place_recognition.datasets.poses import Poses
from hypothesis import given
from hypothesis import strategies as st
import numpy as np

MAX_PIXELS = 10_000_000
SIZES = st.one_of(st.integers(0, 9), st.integers(0, 2**32 - 1))
FLOATS = st.floats(allow_nan=True, allow_infinity=True)


@given(
    encoding=st.one_of(st.sampled_from(SUPPORTED_ENCODINGS), st.text(max_size=8)),
    height=SIZES,
    width=SIZES,
    step=st.one_of(st.integers(0, 80), SIZES),
    is_bigendian=st.integers(0, 255),
    data=st.binary(max_size=600),
)
def test_raw_image(target, **fields):
    check_image(target(ImageConverter(MAX_PIXELS).convert, Fields(**fields)))


@given(
    encoding=st.sampled_from(SUPPORTED_ENCODINGS),
    height=st.integers(1, 6),
    width=st.integers(1, 6),
    padding=st.integers(0, 9),
    is_bigendian=st.booleans(),
    data=st.binary(min_size=600, max_size=600),
)
def test_fitting_raw_image(target, encoding, height, width, padding, is_bigendian, data):
    message = Fields(
        encoding=encoding,
        height=height,
        width=width,
        step=width * 16 + padding,
        is_bigendian=is_bigendian,
        data=data,
    )
    converter = ImageConverter(MAX_PIXELS)
    check_image(target(converter.convert, message))
    check_image(target(converter.convert, message))


def check_image(image):
    """Check the result of a conversion; None if the message was refused."""
    if image is not None:
        assert image.dtype == np.uint8
        assert image.ndim == 2 or image.shape[2] == 3
        assert 0 < image.shape[0] * image.shape[1] <= MAX_PIXELS


def samples():
    """Return small images in every format that OpenCV writes."""
    small = np.random.default_rng(0).integers(0, 256, (6, 8, 3), np.uint8)
    image = cv2.resize(small, (48, 40), interpolation=cv2.INTER_CUBIC)
    wide = image[..., 0].astype(np.uint16) * 16
    options = [
        ('.jpg', image, []),
        ('.jpg', image[..., 0], []),
        ('.jpg', image, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]),
        ('.jpg', image, [cv2.IMWRITE_JPEG_RST_INTERVAL, 2]),
        ('.png', image, []),
        ('.png', wide, []),
        *[(suffix, image, []) for suffix in ('.webp', '.tiff', '.bmp', '.ppm', '.pam', '.ras')],
        ('.tiff', wide, []),
        ('.pgm', image[..., 0], []),
    ]
    return [
        cv2.imencode(suffix, pixels, list(flags))[1].tobytes()
        for suffix, pixels, flags in options
        if cv2.haveImageWriter('image' + suffix)
    ]


def damaged(content):
    """Return a strategy that cuts content, changes bytes, or inserts bytes."""
    positions = st.integers(0, max(len(content) - 1, 0))
    changes = st.lists(st.tuples(positions, st.integers(0, 255)), max_size=6)

    def change(edits, end, inserted, position):
        data = bytearray(content)
        for at, value in edits:
            data[at] = value
        data[position:position] = inserted
        return bytes(data[: len(data) - end])

    lengths = st.one_of(st.just(0), positions)
    return st.builds(change, changes, lengths, st.binary(max_size=8), positions)


FORMATS = [
    'jpeg',
    'png',
    'bgr8; jpeg compressed bgr8',
    'rgb8; png compressed rgb8',
    'bayer_rggb8; png compressed mono8',
    'bayer_rggb8; jpeg compressed ',
    'mono16; png compressed ',
    '16UC1; png compressed ',
    'nv12; png compressed ',
]
COMPRESSED = st.one_of(st.sampled_from(samples()).flatmap(damaged), st.binary(max_size=300))


@given(
    format=st.one_of(st.sampled_from(FORMATS), st.text(max_size=30)),
    data=COMPRESSED,
    oriented=st.booleans(),
)
def test_compressed_image(target, oriented, **fields):
    converter = ImageConverter(MAX_PIXELS, oriented=oriented)
    check_image(target(converter.convert, Fields(**fields)))


@given(
    width=SIZES,
    height=SIZES,
    distortion_model=st.one_of(
        st.sampled_from(['plumb_bob', 'rational_polynomial', 'equidistant', 'fisheye', '']),
        st.text(max_size=9),
    ),
    d=st.lists(st.one_of(st.floats(-1, 1), FLOATS), max_size=16),
    k=st.lists(st.one_of(st.floats(0, 1000), FLOATS), min_size=9, max_size=9),
    p=st.lists(FLOATS, min_size=12, max_size=12),
    binning_x=SIZES,
    binning_y=SIZES,
    roi=st.builds(Fields, x_offset=SIZES, y_offset=SIZES, width=SIZES, height=SIZES),
    rectified=st.booleans(),
    points=st.lists(st.tuples(st.floats(0, 1), st.floats(0, 4)), min_size=1, max_size=5),
)
def test_camera_info(target, rectified, points, **fields):
    camera = target(camera_from_message, Fields(**fields), rectified=rectified)
    if camera is not None:
        rays = target(camera.directions, np.array(points, np.float32))
        assert rays.shape == (len(points), 2)
        assert np.isfinite(camera.matrix).all()


HEADERS = st.builds(
    lambda sec, nanosec, frame: Fields(stamp=Fields(sec=sec, nanosec=nanosec), frame_id=frame),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(0, 2**32 - 1),
    st.sampled_from(['map', '/map', 'odom', '']),
)
VECTORS = st.builds(Fields, x=FLOATS, y=FLOATS, z=FLOATS)
TURNS = st.builds(Fields, x=FLOATS, y=FLOATS, z=FLOATS, w=FLOATS)
POSES = st.builds(Fields, position=VECTORS, orientation=TURNS)
STAMPED = st.builds(Fields, header=HEADERS, pose=POSES)
TRANSFORMS = st.builds(
    Fields,
    header=HEADERS,
    child_frame_id=st.sampled_from(['odom', 'base_link']),
    transform=st.builds(Fields, translation=VECTORS, rotation=TURNS),
)
MESSAGES = st.one_of(
    STAMPED,
    st.builds(Fields, header=HEADERS, pose=st.builds(Fields, pose=POSES)),
    st.builds(Fields, header=HEADERS, poses=st.lists(STAMPED, max_size=3)),
    TRANSFORMS,
    st.builds(Fields, transforms=st.lists(TRANSFORMS, max_size=3)),
    st.builds(
        Fields,
        header=HEADERS,
        status=st.builds(Fields, status=st.integers(-1, 2)),
        latitude=FLOATS,
        longitude=FLOATS,
        altitude=FLOATS,
    ),
)


@given(messages=st.lists(MESSAGES, min_size=1, max_size=3), view_axis=st.sampled_from('xz'))
def test_pose_messages(target, messages, view_axis):
    target(read_poses, messages, view_axis)


def read_poses(messages, view_axis):
    """Convert messages as a bag does; return the viewing directions."""
    converter = PoseConverter()
    found = [pose for message in messages for pose in converter.convert(message)]
    converter.check_frames('topic', '--flag')
    poses = Poses.from_rows([pose.stamp_ns for pose in found], [pose.row for pose in found], 'x')
    assert (np.diff(poses.stamps_ns) > 0).all()
    poses.before(int(poses.stamps_ns[0]), 0)
    return poses.view_directions(view_axis)
