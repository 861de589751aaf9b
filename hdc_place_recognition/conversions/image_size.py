# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Reads the size that an image file claims from its header, before anything is decoded."""

from __future__ import annotations

from collections.abc import Callable
import re
import struct

from hdc_place_recognition.conversions.jpeg import frame_header

Size = tuple[int, int]  # width, height
PNG_MAGIC = b'\x89PNG\r\n\x1a\n'
# Suffixes of the files whose header is understood here; OpenCV decodes all of them.
SUFFIXES = (
    *('.bmp', '.dib', '.gif', '.jp2', '.jpe', '.jpeg', '.jpg', '.pam', '.pbm', '.pgm', '.png'),
    *('.pnm', '.ppm', '.ras', '.sr', '.tif', '.tiff', '.webp'),
)
_PNM = re.compile(rb'P[1-6](?:\s+|#[^\n]*\n)+(\d{1,9})(?:\s+|#[^\n]*\n)+(\d{1,9})\s')
_PAM = re.compile(rb'P7\s.{0,500}?ENDHDR\n', re.DOTALL)
_TIFF_SIDES = {0x100: 'width', 0x101: 'height'}


def claimed_size(data: bytes) -> Size | None:
    """
    Return width and height by the header of a compressed image.

    :return: None if the format is not known or the header is damaged.
    """
    for magic, offset, read in _FORMATS:
        if data.startswith(magic, offset):
            try:
                return read(data)
            except (struct.error, ValueError, KeyError, IndexError):
                return None
    return None


def png_end(data: bytes) -> int:
    """
    Return the end of a PNG image; OpenCV 5 allocates what a chunk claims, up to 2 GB.

    :return: 0 if a chunk claims more bytes than there are, or the last chunk is missing.
    """
    position = len(PNG_MAGIC)
    while position + 12 <= len(data):
        length, name = struct.unpack_from('>I4s', data, position)
        position += 12 + length
        if name == b'IEND' and position <= len(data):
            return position
    return 0


def _png(data: bytes) -> Size:
    return struct.unpack_from('>II', data, 16)


def _bmp(data: bytes) -> Size:
    (header,) = struct.unpack_from('<I', data, 14)
    width, height = struct.unpack_from('<HH' if header == 12 else '<ii', data, 18)
    return abs(width), abs(height)


def _gif(data: bytes) -> Size:
    return struct.unpack_from('<HH', data, 6)


def _sun(data: bytes) -> Size:
    return struct.unpack_from('>II', data, 4)


def _webp(data: bytes) -> Size:
    kind = data[12:16]
    if kind == b'VP8 ':
        width, height = struct.unpack_from('<HH', data, 26)
        return width & 0x3FFF, height & 0x3FFF
    if kind == b'VP8L':
        (bits,) = struct.unpack_from('<I', data, 21)
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b'VP8X':
        width, height = data[24:27], data[27:30]
        return int.from_bytes(width, 'little') + 1, int.from_bytes(height, 'little') + 1
    raise ValueError(kind)


def _pnm(data: bytes) -> Size:
    found = _PNM.match(data[:1000])
    if found is None:
        raise ValueError('no size')
    return int(found[1]), int(found[2])


def _pam(data: bytes) -> Size:
    header = _PAM.match(data[:1000])
    if header is None:
        raise ValueError('no header')
    fields = dict(line.split(None, 1) for line in header[0].splitlines() if b' ' in line)
    return int(fields[b'WIDTH']), int(fields[b'HEIGHT'])


def _jpeg2000(data: bytes) -> Size:
    box = data.index(b'ihdr', 0, 1000)
    height, width = struct.unpack_from('>II', data, box + 4)
    # The codestream has a size of its own, which is the one that is decoded.
    siz = data.index(b'\xff\x4f\xff\x51', box)
    right, bottom, left, top = struct.unpack_from('>IIII', data, siz + 8)
    return max(width, right - left), max(height, bottom - top)


def _tiff(data: bytes) -> Size:
    order = '<' if data.startswith(b'II') else '>'
    (start,) = struct.unpack_from(f'{order}I', data, 4)
    (count,) = struct.unpack_from(f'{order}H', data, start)
    sides = {}
    for entry in range(start + 2, start + 2 + 12 * count, 12):
        tag, kind = struct.unpack_from(f'{order}HH', data, entry)
        if tag in _TIFF_SIDES:
            code = {3: 'H', 4: 'I'}[kind]
            (sides[_TIFF_SIDES[tag]],) = struct.unpack_from(order + code, data, entry + 8)
    return sides['width'], sides['height']


_FORMATS: tuple[tuple[bytes, int, Callable[[bytes], Size]], ...] = (
    (b'\xff\xd8\xff', 0, lambda data: frame_header(data)[:2]),
    (PNG_MAGIC, 0, _png),
    (b'WEBP', 8, _webp),
    (b'BM', 0, _bmp),
    (b'II*\0', 0, _tiff),
    (b'MM\0*', 0, _tiff),
    (b'P7', 0, _pam),
    *((b'P%d' % number, 0, _pnm) for number in range(1, 7)),
    (b'GIF8', 0, _gif),
    (b'\0\0\0\x0cjP  ', 0, _jpeg2000),
    (b'\x59\xa6\x6a\x95', 0, _sun),
)
