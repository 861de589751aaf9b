# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Reads files of unknown origin: regular files only, with bounded size, depth and time."""

from __future__ import annotations

import os
from pathlib import Path
import stat
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
import yaml

MIB = 2**20
# A parameter file has about 6 KB and a depth of 3; longer input only costs time.
_YAML_DEPTH = 20
_YAML_SCALAR = 16384
_LOADER: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


def read_bounded(path: Path, limit: int, what: str) -> bytes:
    """
    Read a regular file of bounded size.

    A pipe or a device is not read: opening it could wait forever.

    :param limit: largest size, bytes.
    :param what: what the file is, for error messages.
    :raises PlaceRecognitionError: the file is missing, unreadable, not regular or too large.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(descriptor, 'rb') as file:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode):
                raise PlaceRecognitionError(
                    f'{what} {path} is not a regular file; give a regular file'
                )
            content = file.read(limit + 1) if status.st_size <= limit else b''
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        reason = getattr(error, 'strerror', None) or error
        raise PlaceRecognitionError(f'{what} {path} cannot be read ({reason})') from error
    if status.st_size > limit or len(content) > limit:
        raise PlaceRecognitionError(
            f'{what} {path} has {max(status.st_size, len(content))} bytes, more than the limit of '
            f'{limit}; give the right file'
        )
    return content


def read_yaml(path: Path, limit: int, what: str) -> Any:
    """
    Read a YAML file without aliases and of bounded size and depth.

    :param limit: largest size, bytes.
    :param what: what the file is, for error messages.
    :raises PlaceRecognitionError: see :func:`read_bounded`; or the content is not valid YAML, is
        nested deeply, or has an alias, which can stand for gigabytes.
    """
    content = read_bounded(path, limit, what)
    try:
        text = content.decode('utf-8')
        _check_yaml(text)
        return yaml.load(text, Loader=_LOADER)
    except Exception as error:  # numbers and dates raise many types of exceptions
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise PlaceRecognitionError(f'{what} {path} is not valid YAML: {reason}') from error


def _check_yaml(text: str) -> None:
    """Raise an error if the document is nested deeply, or has an alias or a very long scalar."""
    depth = 0
    for event in yaml.parse(text, Loader=_LOADER):
        start: Any = event.start_mark
        if isinstance(event, yaml.AliasEvent):
            raise ValueError(f'line {start.line + 1} has an alias; write the value out')
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > _YAML_SCALAR:
            raise ValueError(f'line {start.line + 1} has a value of {len(event.value)} characters')
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > _YAML_DEPTH:
            raise ValueError(f'line {start.line + 1} is nested too deeply')
