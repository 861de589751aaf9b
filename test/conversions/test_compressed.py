# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Compressed images: incomplete, with bytes behind their end, of any format, too large."""

import struct
from time import perf_counter
from types import SimpleNamespace
import zlib

import cv2
from hdc_place_recognition.conversions.image import image_from_message, ImageConverter
from hdc_place_recognition.conversions.image_size import claimed_size
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
import pytest

END = b'\xff\xd9'
BASELINE, PROGRESSIVE = (), (cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
RESTARTS = (cv2.IMWRITE_JPEG_RST_INTERVAL, 4)


def picture(channels=3):
    """Return a BGR or gray image of 240 x 320 with detail everywhere."""
    small = np.random.default_rng(3).integers(0, 256, (20, 30, channels), np.uint8)
    return cv2.resize(small, (320, 240), interpolation=cv2.INTER_CUBIC)


def jpeg(image, options=BASELINE):
    return cv2.imencode('.jpg', image, list(options))[1].tobytes()


def decoded(data, format_='jpeg'):
    return image_from_message(SimpleNamespace(format=format_, data=data))


@pytest.mark.parametrize('channels', [1, 3])
@pytest.mark.parametrize('options', [BASELINE, PROGRESSIVE, RESTARTS])
@pytest.mark.parametrize(
    'behind', [bytes(100), b'\xff\xda' + bytes(100), b'\xff\xd8\xff\xe0', b'\xff\xda\xff\xd9']
)
def test_bytes_behind_the_end_of_a_jpeg(channels, options, behind):
    data = jpeg(picture(channels), options)
    np.testing.assert_array_equal(decoded(data + behind), decoded(data))


@pytest.mark.parametrize('channels', [1, 3])
@pytest.mark.parametrize('options', [BASELINE, RESTARTS])
def test_a_jpeg_with_a_missing_part_is_refused(channels, options):
    data = jpeg(picture(channels), options)
    third = len(data) // 3
    for cut in (
        data[:third] + END,
        data[: 2 * third] + END,
        data[:-600] + END,
        data[:third] + data[2 * third :],
        data[: 2 * third] + data[2 * third + 600 :],
    ):
        with pytest.raises(PlaceRecognitionError, match='it is cut short, damaged'):
            decoded(cut)


@pytest.mark.parametrize('share', [0.3, 0.6, 0.9])
def test_a_progressive_jpeg_with_an_end_too_early_is_refused(share):
    data = jpeg(picture(), PROGRESSIVE)
    with pytest.raises(PlaceRecognitionError, match='cut short'):
        decoded(data[: int(share * len(data))] + END)


def test_a_jpeg_that_ends_gray_is_complete():
    image = picture()
    image[200:] = 128
    np.testing.assert_array_equal(decoded(jpeg(image))[230:], 128)


@pytest.mark.parametrize('order', ['rggb', 'bggr', 'gbrg', 'grbg'])
@pytest.mark.parametrize(('extension', 'codec'), [('.jpg', 'jpeg'), ('.png', 'png')])
def test_a_bayer_image_is_demosaiced_once(order, extension, codec):
    data = cv2.imencode(extension, picture(1))[1].tobytes()
    stored = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
    gray = decoded(data, f'bayer_{order}8; {codec} compressed mono8')
    np.testing.assert_array_equal(gray, stored)
    assert decoded(data, f'bayer_{order}8; {codec} compressed bayer_{order}8').ndim == 3
    assert decoded(data, f'bayer_{order}8; {codec} compressed ').ndim == 3


FORMATS = ['.jpg', '.png', '.webp', '.tiff', '.bmp', '.ppm', '.pgm', '.pam', '.ras', '.jp2']


@pytest.mark.parametrize('extension', FORMATS)
def test_formats_and_their_size(extension):
    image = picture(1 if extension == '.pgm' else 3)
    if not cv2.haveImageWriter('image' + extension):
        pytest.skip(f'OpenCV writes no {extension}')
    data = cv2.imencode(extension, image)[1].tobytes()
    assert claimed_size(data) == (320, 240)
    result = decoded(data)
    assert result.shape == image.shape
    assert np.abs(result.astype(int) - image).mean() < 6


def png_header(width, height):
    """Return a small PNG file that claims a size."""
    body = b'IHDR' + struct.pack('>IIBBBBB', width, height, 8, 2, 0, 0, 0)
    chunk = struct.pack('>I', 13) + body + struct.pack('>I', zlib.crc32(body))
    return b'\x89PNG\r\n\x1a\n' + chunk + bytes(4000)


def jpeg_header(width, height):
    """Return a small JPEG file that claims a size."""
    data = jpeg(picture())
    frame = data.index(b'\xff\xc0')
    return data[: frame + 5] + struct.pack('>HH', height, width) + data[frame + 9 :]


@pytest.mark.parametrize('header', [png_header, jpeg_header])
def test_a_size_that_is_too_large_is_refused_by_the_header(header):
    with pytest.raises(
        PlaceRecognitionError, match=r'30000 x 30000 has more than max_image_pixels = 50000000'
    ):
        decoded(header(30000, 30000))


def test_the_limit_of_pixels():
    converter = ImageConverter(max_pixels=320 * 240)
    assert converter.convert(SimpleNamespace(format='', data=jpeg(picture()))).size
    converter.max_pixels -= 1
    with pytest.raises(PlaceRecognitionError, match='raise max_image_pixels'):
        converter.convert(SimpleNamespace(format='', data=jpeg(picture())))
    raw = SimpleNamespace(
        height=240, width=320, encoding='mono8', is_bigendian=0, step=320, data=bytes(240 * 320)
    )
    with pytest.raises(PlaceRecognitionError, match='320 x 240 has more than max_image_pixels'):
        converter.convert(raw)


@pytest.mark.parametrize('data', [b'II*\0' + bytes(20), b'P6\n', b'RIFF\0\0\0\0WEBPVP8 ', b'BM'])
def test_a_damaged_header(data):
    assert claimed_size(data) is None
    with pytest.raises(PlaceRecognitionError, match='cannot be decoded'):
        decoded(data)


def test_a_converter_keeps_the_brightness_of_a_12_bit_camera():
    bright = np.linspace(0, 4095, 320 * 240).astype('<u2').reshape(240, 320)

    def message(pixels):
        return SimpleNamespace(
            height=240, width=320, encoding='mono16', is_bigendian=0, step=640,
            data=pixels.tobytes(),
        )  # fmt: skip

    converter = ImageConverter()
    assert converter.convert(message(bright)).max() == 255
    assert converter.convert(message(bright // 4)).max() == 63


@pytest.mark.parametrize('length', [2**31 - 1, 2**24, 2**13])
def test_a_png_chunk_that_claims_more_than_there_is(length):
    data = bytearray(cv2.imencode('.png', picture()[:8, :8])[1].tobytes())
    at = data.index(b'IDAT') - 4
    data[at : at + 4] = struct.pack('>I', length)
    start = perf_counter()
    with pytest.raises(PlaceRecognitionError, match='cannot be decoded'):
        decoded(bytes(data))
    assert perf_counter() - start < 0.5
