# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Conversion of image messages: every encoding, with padding, in both byte orders."""

from array import array
from types import SimpleNamespace

import cv2
from hdc_place_recognition.conversions.image import (
    image_from_message,
    stamp_ns,
    SUPPORTED_ENCODINGS,
)
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
import pytest

PADDING = 5
BLUE, GREEN, RED = [255, 0, 0], [0, 255, 0], [0, 0, 255]
# (Y, U, V) of full-scale primary colors by ITU-R BT.601.
YUV = {'blue': (41, 240, 110), 'green': (145, 54, 34), 'red': (81, 90, 240)}
# Samples per pixel and their type, for all encodings with one plane.
LAYOUTS = {
    **dict.fromkeys(['mono8', '8UC1'], (1, 'u1')),
    **dict.fromkeys(['bgr8', 'rgb8', '8UC3'], (3, 'u1')),
    **dict.fromkeys(['bgra8', 'rgba8', '8UC4'], (4, 'u1')),
    **dict.fromkeys(['mono16', '16UC1'], (1, 'u2')),
    **dict.fromkeys(['bgr16', 'rgb16', '16UC3'], (3, 'u2')),
    **dict.fromkeys(['bgra16', 'rgba16', '16UC4'], (4, 'u2')),
    **dict.fromkeys(['16SC1'], (1, 'i2')),
    **{f'32FC{channels}': (channels, 'f4') for channels in (1, 3, 4)},
    **dict.fromkeys([f'bayer_{order}8' for order in ('rggb', 'bggr', 'gbrg', 'grbg')], (1, 'u1')),
    **dict.fromkeys([f'bayer_{order}16' for order in ('rggb', 'bggr', 'gbrg', 'grbg')], (1, 'u2')),
    **dict.fromkeys(['uyvy', 'yuv422', 'yuyv', 'yuv422_yuy2'], (2, 'u1')),
}
TWO_PLANES = ('nv12', 'nv21', 'nv24')
CONTAINERS = {
    'bytes': bytes,
    'bytearray': bytearray,
    'array': lambda data: array('B', data),
    'numpy': lambda data: np.frombuffer(data, np.uint8),
}


def padded(rows: np.ndarray, padding: int) -> bytes:
    """Return the bytes of the rows; random padding follows each row except the last."""
    garbage = bytes(201 + i % 50 for i in range(padding))
    return garbage.join(row.tobytes() for row in rows)


def message(encoding, pixels, padding=0, big=False, container=bytes):
    """Return an image message of pixels (h, w) or (h, w, channels)."""
    pixels = np.asarray(pixels)
    pixels = pixels.astype(pixels.dtype.newbyteorder('>' if big else '<'))
    return SimpleNamespace(
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=int(big),
        step=pixels[0].nbytes + padding,
        data=container(padded(pixels, padding)),
    )


def two_planes(encoding, luma, chroma, padding=0):
    """Return an image message of luma (h, w) and chroma (h', w', 2)."""
    made = message(encoding, luma, padding)
    chroma_padding = padding * chroma[0].nbytes // luma[0].nbytes
    made.data += bytes(padding) + padded(chroma, chroma_padding)
    return made


def random_pixels(encoding, height=6, width=8):
    """Return random pixels for an encoding with one plane."""
    channels, dtype = LAYOUTS[encoding]
    rng = np.random.default_rng(7)
    if dtype == 'f4':
        return rng.normal(size=(height, width, channels)).astype(np.float32)
    info = np.iinfo(dtype)
    return rng.integers(info.min, info.max, (height, width, channels), dtype, endpoint=True)


def compressed(pixels, extension, format_):
    """Return a compressed message of pixels."""
    data = cv2.imencode(extension, pixels)[1].tobytes()
    return SimpleNamespace(format=format_, data=array('B', data))


def picture(height=48, width=64):
    """Return a smooth BGR image, with small JPEG errors."""
    small = np.random.default_rng(3).integers(0, 256, (4, 5, 3), np.uint8)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_CUBIC)


def test_the_layouts_cover_every_supported_encoding():
    assert set(SUPPORTED_ENCODINGS) == {*LAYOUTS, *TWO_PLANES}
    assert len(set(SUPPORTED_ENCODINGS)) == len(SUPPORTED_ENCODINGS)


# --- Small images, by hand

PIXELS = [
    ('mono8', np.uint8([[0, 7], [200, 255]]), [[0, 7], [200, 255]]),
    ('8UC1', np.uint8([[0, 7], [200, 255]]), [[0, 7], [200, 255]]),
    ('bgr8', np.uint8([[[1, 2, 3], [4, 5, 6]]]), [[[1, 2, 3], [4, 5, 6]]]),
    ('8UC3', np.uint8([[[1, 2, 3], [4, 5, 6]]]), [[[1, 2, 3], [4, 5, 6]]]),
    ('rgb8', np.uint8([[[1, 2, 3], [4, 5, 6]]]), [[[3, 2, 1], [6, 5, 4]]]),
    ('bgra8', np.uint8([[[1, 2, 3, 9], [4, 5, 6, 9]]]), [[[1, 2, 3], [4, 5, 6]]]),
    ('8UC4', np.uint8([[[1, 2, 3, 9], [4, 5, 6, 9]]]), [[[1, 2, 3], [4, 5, 6]]]),
    ('rgba8', np.uint8([[[1, 2, 3, 9], [4, 5, 6, 9]]]), [[[3, 2, 1], [6, 5, 4]]]),
    ('mono16', np.uint16([[0, 0x0100, 0x80FF, 0xFFFF]]), [[0, 1, 128, 255]]),
    ('bgr16', np.uint16([[[0x0100, 0x0200, 0xFFFF]]]), [[[1, 2, 255]]]),
    ('16UC3', np.uint16([[[0x0100, 0x0200, 0xFFFF]]]), [[[1, 2, 255]]]),
    ('rgb16', np.uint16([[[0x0100, 0x0200, 0xFFFF]]]), [[[255, 2, 1]]]),
    ('bgra16', np.uint16([[[0x0100, 0x0200, 0xFFFF, 0x0900]]]), [[[1, 2, 255]]]),
    ('16UC4', np.uint16([[[0x0100, 0x0200, 0xFFFF, 0x0900]]]), [[[1, 2, 255]]]),
    ('rgba16', np.uint16([[[0x0100, 0x0200, 0xFFFF, 0x0900]]]), [[[255, 2, 1]]]),
    # A thermal camera (1/100 K) and a depth camera (mm, 0 for unknown).
    ('16UC1', np.uint16([[29000, 29100], [29255, 29510]]), [[0, 50], [128, 255]]),
    ('16UC1', np.uint16([[0, 1000, 5000]]), [[0, 51, 255]]),
    ('16UC1', np.uint16([[300, 300]]), [[0, 0]]),
    ('16SC1', np.int16([[-100, 0, 155]]), [[0, 100, 255]]),
    (
        '32FC1',
        np.float32([[0.5, np.nan, 1.5], [np.inf, 1.0, -np.inf]]),
        [[0, 0, 255], [0, 128, 0]],
    ),
    ('32FC1', np.float32([[np.nan, np.inf]]), [[0, 0]]),
    ('32FC3', np.float32([[[0.0, 0.2, 0.6], [1.0, 0.4, 0.8]]]), [[[0, 51, 153], [255, 102, 204]]]),
    ('32FC4', np.float32([[[0.0, 0.2, 1.0, 9.0]]]), [[[0, 51, 255]]]),
]


@pytest.mark.parametrize('big', [False, True], ids=['little', 'big'])
@pytest.mark.parametrize('padding', [0, 1, PADDING])
@pytest.mark.parametrize(('encoding', 'pixels', 'expected'), PIXELS)
def test_small_images(encoding, pixels, expected, padding, big):
    result = image_from_message(message(encoding, pixels, padding, big))
    np.testing.assert_array_equal(result, expected)
    assert result.dtype == np.uint8


@pytest.mark.parametrize('padding', [0, PADDING])
@pytest.mark.parametrize('bits', [8, 16])
@pytest.mark.parametrize('order', ['rggb', 'bggr', 'gbrg', 'grbg'])
def test_bayer_patterns_of_a_uniform_color(order, bits, padding):
    levels = {'r': 200, 'g': 100, 'b': 50}
    tile = np.reshape([levels[channel] for channel in order], (2, 2))
    mosaic = np.tile(tile, (4, 5)).astype(np.uint8)
    if bits == 16:
        mosaic = mosaic.astype(np.uint16) << 8
    result = image_from_message(message(f'bayer_{order}{bits}', mosaic, padding))
    np.testing.assert_array_equal(result, np.broadcast_to([50, 100, 200], (8, 10, 3)))


@pytest.mark.parametrize('padding', [0, PADDING])
@pytest.mark.parametrize(
    ('encodings', 'order'),
    [(('uyvy', 'yuv422'), [1, 0, 2, 0]), (('yuyv', 'yuv422_yuy2'), [0, 1, 0, 2])],
)
def test_yuv_422(encodings, order, padding):
    # Four samples are two pixels: blue and red in row 0, green and white in row 1.
    tiles = [[YUV['blue'], YUV['red']], [YUV['green'], (235, 128, 128)]]
    samples = np.uint8([[[tile[i] for i in order] for tile in row] for row in tiles])
    pixels = samples.reshape(2, 4, 2)
    expected = np.repeat([[BLUE, RED], [GREEN, [255, 255, 255]]], 2, axis=1)
    for encoding in encodings:
        result = image_from_message(message(encoding, pixels, padding))
        np.testing.assert_allclose(result, expected, atol=2)


@pytest.mark.parametrize('padding', [0, 6])
@pytest.mark.parametrize(('encoding', 'order'), [('nv12', [1, 2]), ('nv21', [2, 1])])
def test_yuv_420(encoding, order, padding):
    names = ['blue', 'red']
    luma = np.repeat(np.repeat(np.uint8([[YUV[name][0] for name in names]]), 2, 0), 2, 1)
    chroma = np.uint8([[[YUV[name][i] for i in order] for name in names]])
    result = image_from_message(two_planes(encoding, luma, chroma, padding))
    np.testing.assert_allclose(result, np.tile(np.repeat([[BLUE, RED]], 2, 1), (2, 1, 1)), atol=2)


@pytest.mark.parametrize('padding', [0, PADDING])
def test_yuv_444(padding):
    names = [['blue', 'red', 'green'], ['green', 'blue', 'red']]
    pixels = np.uint8([[YUV[name] for name in row] for row in names])
    made = two_planes('nv24', pixels[..., 0], pixels[..., 1:], padding)
    expected = [[BLUE, RED, GREEN], [GREEN, BLUE, RED]]
    np.testing.assert_allclose(image_from_message(made), expected, atol=2)


# --- Comparison with other implementations

ORACLE = [
    *((encoding, 'mono8') for encoding in ('mono8', 'mono16')),
    *((encoding, '8UC1') for encoding in ('8UC1',)),
    *((encoding, '8UC3') for encoding in ('8UC3',)),
    *((f'{order}{bits}', 'bgr8') for order in ('bgr', 'rgb', 'bgra', 'rgba') for bits in (8, 16)),
    *((encoding, 'bgr8') for encoding in LAYOUTS if encoding.startswith(('bayer', 'uyvy', 'yu'))),
]


@pytest.mark.parametrize('big', [False, True], ids=['little', 'big'])
@pytest.mark.parametrize(('encoding', 'target'), ORACLE)
def test_agrees_with_rosbags_image(encoding, target, big):
    oracle = pytest.importorskip('rosbags.image').image_to_cvimage
    pixels = random_pixels(encoding)
    result = image_from_message(message(encoding, pixels, PADDING, big))
    expected = oracle(message(encoding, pixels, 0, big), target)
    # rosbags rounds 16-bit values differently, by at most one level.
    np.testing.assert_allclose(
        result.astype(int), expected, atol=1 if LAYOUTS[encoding][1] == 'u2' else 0
    )


@pytest.mark.parametrize(
    ('encoding', 'code'), [('nv12', cv2.COLOR_YUV2BGR_NV12), ('nv21', cv2.COLOR_YUV2BGR_NV21)]
)
def test_agrees_with_opencv_on_planes_in_one_array(encoding, code):
    rows = np.random.default_rng(5).integers(0, 256, (9, 8), np.uint8)
    made = two_planes(encoding, rows[:6], rows[6:].reshape(3, 4, 2), padding=4)
    np.testing.assert_array_equal(image_from_message(made), cv2.cvtColor(rows, code))


# --- All encodings


@pytest.mark.parametrize('padding', [1, 2, PADDING, 64])
@pytest.mark.parametrize('encoding', LAYOUTS)
def test_padding_and_byte_order_change_nothing(encoding, padding):
    pixels = random_pixels(encoding)
    expected = image_from_message(message(encoding, pixels))
    for big in (False, True):
        result = image_from_message(message(encoding, pixels, padding, big))
        np.testing.assert_array_equal(result, expected)
        assert result.flags.c_contiguous
        assert result.dtype == np.uint8
        assert result.shape in {(6, 8), (6, 8, 3)}


@pytest.mark.parametrize('container', CONTAINERS)
@pytest.mark.parametrize('encoding', LAYOUTS)
def test_the_message_is_never_modified(encoding, container):
    made = message(encoding, random_pixels(encoding), PADDING, container=CONTAINERS[container])
    before = bytes(made.data)
    result = image_from_message(made)
    assert bytes(made.data) == before
    plain = message(encoding, random_pixels(encoding))
    np.testing.assert_array_equal(result, image_from_message(plain))


@pytest.mark.parametrize('container', CONTAINERS)
@pytest.mark.parametrize('encoding', ['mono8', 'bgr8', '8UC1', '8UC3'])
def test_an_image_that_shares_memory_is_read_only(encoding, container):
    made = message(encoding, random_pixels(encoding), container=CONTAINERS[container])
    result = image_from_message(made)
    assert np.shares_memory(result, np.frombuffer(made.data, np.uint8))
    assert not result.flags.writeable
    expected = result.copy()
    del made
    np.testing.assert_array_equal(result, expected)


@pytest.mark.parametrize('padding', [0, PADDING])
def test_the_last_row_may_have_padding(padding):
    pixels = random_pixels('bgr8')
    made = message('bgr8', pixels, padding)
    made.data += bytes(padding + 100)
    np.testing.assert_array_equal(image_from_message(made), pixels)


@pytest.mark.parametrize('encoding', LAYOUTS)
def test_tiny_images(encoding):
    for height, width in [(1, 2), (2, 2), (1, 4)]:
        result = image_from_message(message(encoding, random_pixels(encoding, height, width)))
        assert result.shape[:2] == (height, width)


# --- Bad messages


def changed(**fields):
    """Return a padded bgr8 message of 6 x 8 pixels with some fields changed."""
    made = message('bgr8', random_pixels('bgr8'), PADDING)
    for name, value in fields.items():
        setattr(made, name, value)
    return made


@pytest.mark.parametrize('missing', [1, 29, 100, 169])
def test_data_too_short(missing):
    made = changed()
    made.data = made.data[:-missing]
    expected = (
        "encoding 'bgr8', height 6, width 8 and step 29 needs 169 bytes of data, not "
        f'{169 - missing}: check the driver'
    )
    with pytest.raises(PlaceRecognitionError, match=expected):
        image_from_message(made)


@pytest.mark.parametrize('encoding', SUPPORTED_ENCODINGS)
def test_one_byte_missing_in_every_encoding(encoding):
    if encoding in TWO_PLANES:
        subsampling = 1 if encoding == 'nv24' else 2
        chroma = np.zeros((4 // subsampling, 4 // subsampling, 2), np.uint8)
        made = two_planes(encoding, np.zeros((4, 4), np.uint8), chroma, PADDING)
    else:
        made = message(encoding, random_pixels(encoding), PADDING)
    assert image_from_message(made).ndim in {2, 3}
    made.data = made.data[:-1]
    have, need = len(made.data), len(made.data) + 1
    with pytest.raises(PlaceRecognitionError, match=f'{encoding}.*needs {need} .*not {have}'):
        image_from_message(made)


@pytest.mark.parametrize('step', [0, 8, 23])
def test_step_shorter_than_a_row(step):
    with pytest.raises(PlaceRecognitionError, match=f'step {step} needs a step of at least 24'):
        image_from_message(changed(step=step))


@pytest.mark.parametrize('fields', [{'height': 0}, {'width': 0}, {'height': 0, 'width': 0}])
def test_zero_size(fields):
    with pytest.raises(PlaceRecognitionError, match=r'bgr8.* needs at least one pixel'):
        image_from_message(changed(**fields))


def test_huge_size():
    with pytest.raises(PlaceRecognitionError, match='needs 124554051550 bytes of data, not 169'):
        image_from_message(changed(height=2**32 - 1))


@pytest.mark.parametrize('encoding', ['8UC2', 'BGR8', 'jpeg', '', 'two\nlines'])
def test_unknown_encoding(encoding):
    with pytest.raises(
        PlaceRecognitionError, match='not supported; supported are mono8, '
    ) as error:
        image_from_message(changed(encoding=encoding))
    assert repr(encoding) in str(error.value)
    assert all(name in str(error.value) for name in SUPPORTED_ENCODINGS)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize(
    ('encoding', 'height', 'width', 'needed'),
    [
        ('uyvy', 2, 3, 'a height divisible by 1 and a width by 2'),
        ('yuv422_yuy2', 2, 3, 'a height divisible by 1 and a width by 2'),
        ('nv12', 3, 2, 'a height divisible by 2 and a width by 2'),
        ('nv21', 2, 3, 'a height divisible by 2 and a width by 2'),
    ],
)
def test_sizes_must_be_multiples_of_the_subsampling(encoding, height, width, needed):
    made = changed(encoding=encoding, height=height, width=width)
    with pytest.raises(PlaceRecognitionError, match=f'{encoding}.* needs {needed}'):
        image_from_message(made)


# --- Compressed images


@pytest.mark.parametrize('format_', ['jpeg', '', 'bgr8; jpeg compressed bgr8', 'rgb8; jpeg'])
def test_color_jpeg(format_):
    result = image_from_message(compressed(picture(), '.jpg', format_))
    assert result.shape == (48, 64, 3)
    assert np.abs(result.astype(int) - picture()).mean() < 6


@pytest.mark.parametrize('format_', ['jpeg', '', 'mono8; jpeg compressed ', 'mono16; jpeg'])
def test_gray_jpeg_stays_gray(format_):
    gray = picture()[..., 0]
    result = image_from_message(compressed(gray, '.jpg', format_))
    assert result.shape == (48, 64)
    assert np.abs(result.astype(int) - gray).mean() < 3


@pytest.mark.parametrize('format_', ['png', 'rgb8; png compressed bgr8', 'bgr8; png compressed '])
def test_color_png(format_):
    result = image_from_message(compressed(picture(), '.png', format_))
    np.testing.assert_array_equal(result, picture())


def test_compressed_rgb_order():
    made = compressed(picture()[..., ::-1], '.png', 'rgb8; png compressed rgb8')
    np.testing.assert_array_equal(image_from_message(made), picture())


def test_alpha_of_a_png_is_dropped():
    bgra = np.dstack([picture(), picture()[..., 1]])
    result = image_from_message(compressed(bgra, '.png', 'bgra8; png compressed bgr8'))
    np.testing.assert_array_equal(result, picture())


def test_16_bit_png_is_full_scale():
    wide = picture().astype(np.uint16) * 257
    for pixels, format_ in [
        (wide[..., 0], 'mono16; png compressed '),
        (wide[..., 0], 'png'),
        (wide, 'bgr16; png compressed bgr16'),
    ]:
        result = image_from_message(compressed(pixels, '.png', format_))
        np.testing.assert_array_equal(result, picture()[..., 0] if pixels.ndim == 2 else picture())


@pytest.mark.parametrize('encoding', ['16UC1', 'mono16', 'bayer_rggb8', 'bayer_gbrg16', 'mono8'])
def test_compressed_raw_encodings_equal_the_raw_message(encoding):
    pixels = random_pixels(encoding)[..., 0]
    result = image_from_message(compressed(pixels, '.png', f'{encoding}; png compressed '))
    np.testing.assert_array_equal(result, image_from_message(message(encoding, pixels)))


def test_an_orientation_in_the_file_is_ignored():
    data = cv2.imencode('.jpg', picture())[1].tobytes()
    # EXIF, big-endian, with a single entry: orientation (0x0112) is "rotated by 90 degrees" (6).
    tiff = b'MM\0\x2a\0\0\0\x08' + b'\0\x01' + b'\x01\x12\0\x03\0\0\0\x01\0\x06\0\0' + bytes(4)
    exif = b'Exif\0\0' + tiff
    segment = b'\xff\xe1' + (len(exif) + 2).to_bytes(2, 'big') + exif
    turned = data[:2] + segment + data[2:]
    assert cv2.imdecode(np.frombuffer(turned, np.uint8), cv2.IMREAD_COLOR).shape == (64, 48, 3)
    result = image_from_message(SimpleNamespace(format='jpeg', data=turned))
    assert result.shape == (48, 64, 3)


@pytest.mark.parametrize('extension', ['.jpg', '.png'])
@pytest.mark.parametrize('kept', [0, 1, 20, 0.3, 0.6, 0.99, -2])
def test_truncated_file(extension, kept):
    data = cv2.imencode(extension, picture())[1].tobytes()
    data = data[: int(kept * len(data)) if isinstance(kept, float) else kept]
    made = SimpleNamespace(format='rgb8; anything', data=array('B', data))
    expected = f"format 'rgb8; anything' and {len(data)} bytes cannot be decoded: it is cut short"
    with pytest.raises(PlaceRecognitionError, match=expected):
        image_from_message(made)


def test_bytes_after_the_file_are_ignored():
    for extension in ('.jpg', '.png'):
        made = compressed(picture(), extension, 'any')
        expected = image_from_message(made)
        made.data.extend(bytes(50))
        np.testing.assert_array_equal(image_from_message(made), expected)


@pytest.mark.parametrize('data', [b'', b'not an image at all', bytes(1000), b'\xff\xd8\xff'])
def test_data_that_is_not_an_image(data):
    made = SimpleNamespace(format='h264', data=data)
    with pytest.raises(PlaceRecognitionError, match=f"'h264' and {len(data)} bytes cannot be dec"):
        image_from_message(made)


@pytest.mark.parametrize('format_', ['16UC1; compressedDepth png', '32FC1; compressedDepth'])
def test_compressed_depth(format_):
    made = compressed(picture()[..., 0], '.png', format_)
    with pytest.raises(PlaceRecognitionError, match=f"'{format_}' holds depth: take the topic"):
        image_from_message(made)


# --- Stamps, and messages of the real classes


@pytest.mark.parametrize(
    ('sec', 'nanosec', 'expected'),
    [
        (1732233600, 1, 1732233600000000001),
        (1732233600, 999999999, 1732233600999999999),
        (np.int32(2147483647), np.uint32(999999999), 2147483647999999999),
        (0, 0, 0),
    ],
)
def test_stamps_are_exact(sec, nanosec, expected):
    made = SimpleNamespace(header=SimpleNamespace(stamp=SimpleNamespace(sec=sec, nanosec=nanosec)))
    assert stamp_ns(made) == expected
    assert type(stamp_ns(made)) is int


@pytest.mark.parametrize('encoding', LAYOUTS)
def test_messages_of_rclpy(encoding):
    real = pytest.importorskip('sensor_msgs.msg').Image()
    pixels = random_pixels(encoding)
    made = message(encoding, pixels, PADDING)
    for name in ('height', 'width', 'encoding', 'is_bigendian', 'step'):
        setattr(real, name, getattr(made, name))
    real.data = made.data
    real.header.stamp.sec, real.header.stamp.nanosec = 1732233600, 123456789
    np.testing.assert_array_equal(image_from_message(real), image_from_message(made))
    assert stamp_ns(real) == 1732233600123456789


def test_a_compressed_message_of_rclpy():
    made = compressed(picture(), '.png', 'rgb8; png compressed bgr8')
    real = pytest.importorskip('sensor_msgs.msg').CompressedImage(format=made.format)
    real.data = made.data
    np.testing.assert_array_equal(image_from_message(real), picture())


@pytest.mark.parametrize('encoding', ['mono8', 'rgb8', 'mono16', 'bayer_rggb8'])
def test_messages_of_rosbags(encoding):
    typesys = pytest.importorskip('rosbags.typesys')
    types = typesys.get_typestore(typesys.Stores.ROS2_JAZZY).types
    made = message(encoding, random_pixels(encoding), PADDING)
    stamp = types['builtin_interfaces/msg/Time'](sec=1732233600, nanosec=123456789)
    real = types['sensor_msgs/msg/Image'](
        header=types['std_msgs/msg/Header'](stamp=stamp, frame_id='camera'),
        height=made.height,
        width=made.width,
        encoding=made.encoding,
        is_bigendian=made.is_bigendian,
        step=made.step,
        data=np.frombuffer(made.data, np.uint8),
    )
    np.testing.assert_array_equal(image_from_message(real), image_from_message(made))
    assert stamp_ns(real) == 1732233600123456789
