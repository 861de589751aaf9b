# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Finds the end of a JPEG image and whether a part of it is missing.

libjpeg fills what is missing with gray and only warns, and OpenCV drops the warning. USB cameras
send such images, and buffers of a fixed size that have anything behind the end of the image.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import re
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

Decode = Callable[[bytes], 'NDArray[Any] | None']
START = b'\xff\xd8'
_END, _SCAN, _RESTART_INTERVAL = 0xD9, 0xDA, 0xDD
# Start of frame: every C0 to CF but the tables C4 and CC, and C8, which is reserved.
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_PROGRESSIVE = 0xC2
_ALONE = frozenset([0x01, *range(0xD0, 0xD9)])  # markers without a length
# In coded data FF 00 is a byte and FF D0 to FF D7 restart it.
_MARKER = re.compile(rb'\xff[^\x00\xd0-\xd7\xff]')
_RESTART = re.compile(rb'\xff[\xd0-\xd7]')
# Bytes without a marker that no decoder takes for the end of the data.
_FILLER = bytes(range(1, 200))
_GRAY = 128  # what libjpeg writes where data are missing


@dataclass(frozen=True)
class _Segment:
    """A marker with its payload and, after a start of scan, the end of the coded data."""

    marker: int
    start: int
    end: int
    coded_end: int = 0


def frame_header(data: bytes) -> tuple[int, int, int]:
    """
    Return width, height and the marker of the frame.

    :raises ValueError: there is none.
    """
    for segment in _segments(data):
        if segment.marker in _FRAMES:
            height, width = struct.unpack_from('>HH', data, segment.start + 1)
            return width, height, segment.marker
    raise ValueError('no frame')


def decode_whole(data: bytes, decode: Decode) -> NDArray[Any] | None:
    """
    Decode a JPEG image without what is behind its end.

    :param decode: decodes a compressed image; None if it cannot be decoded.
    :return: None if a part is missing or it cannot be decoded.
    """
    try:
        segments = list(_segments(data))
    except (ValueError, struct.error, IndexError):
        return None
    scans = [segment for segment in segments if segment.marker == _SCAN]
    frames = [segment for segment in segments if segment.marker in _FRAMES]
    if not scans or not frames or segments[-1].marker != _END:
        return None
    whole = data[: segments[-1].end]
    if _restarts_missing(whole, segments, frames[0], scans):
        return None
    pixels = decode(whole)
    if pixels is None:
        return None
    # The last block is gray if the data ended before it. A progressive image is blurred instead.
    suspect = frames[0].marker == _PROGRESSIVE or bool(np.all(pixels[-1, -1] == _GRAY))
    if suspect and not _complete(whole, scans[-1].coded_end, pixels, decode):
        return None
    return pixels


def _complete(data: bytes, end: int, pixels: NDArray[Any], decode: Decode) -> bool:
    """Return whether more data behind the last scan change nothing: it was complete."""
    longer = decode(data[:end] + _FILLER + data[end:])
    return longer is not None and np.array_equal(longer, pixels)


def _segments(data: bytes) -> Iterator[_Segment]:
    """
    Yield the segments up to the end of the image.

    :raises ValueError: the data end before.
    """
    position = len(START)
    while True:
        found = data.find(b'\xff', position)
        position = found + 1
        while found >= 0 and data[position : position + 1] == b'\xff':  # fill bytes
            position += 1
        if found < 0 or position >= len(data):
            raise ValueError('cut short')
        marker = data[position]
        position += 1
        if marker == _END:
            yield _Segment(marker, position, position)
            return
        if marker in _ALONE or marker == 0:
            continue
        (length,) = struct.unpack_from('>H', data, position)
        start, end = position + 2, position + max(length, 2)
        position = _coded_end(data, end) if marker == _SCAN else end
        yield _Segment(marker, start, end, position)


def _coded_end(data: bytes, start: int) -> int:
    """Return the end of the coded data of a scan."""
    found = _MARKER.search(data, start)
    if found is None:
        raise ValueError('cut short')
    return found.start()


def _restarts_missing(
    data: bytes, segments: list[_Segment], frame: _Segment, scans: list[_Segment]
) -> bool:
    """Return whether a scan of all components has fewer restart markers than its size needs."""
    intervals = [segment for segment in segments if segment.marker == _RESTART_INTERVAL]
    if not intervals or len(scans) != 1:
        return False
    try:
        (interval,) = struct.unpack_from('>H', data, intervals[-1].start)
        blocks = _coded_units(data, frame)
    except (struct.error, IndexError):
        return True
    if not interval:
        return False
    present = len(_RESTART.findall(data, scans[0].end, scans[0].coded_end))
    return present < -(-blocks // interval) - 1


def _coded_units(data: bytes, frame: _Segment) -> int:
    """Return the number of coded units (MCU) of a frame."""
    height, width, components = struct.unpack_from('>HHB', data, frame.start + 1)
    factors = [data[frame.start + 7 + 3 * number] for number in range(components)]
    across, down = 8, 8
    if components > 1:
        across *= max(factor >> 4 for factor in factors)
        down *= max(factor & 15 for factor in factors)
    return -(-width // max(across, 1)) * -(-height // max(down, 1))
