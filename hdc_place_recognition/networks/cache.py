# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Files that are generated once and stored in the cache folder of the user."""

from __future__ import annotations

from collections.abc import Callable
import hashlib
import logging
import os
from pathlib import Path
import tempfile

from hdc_place_recognition.bounded_files import MIB, read_bounded
from hdc_place_recognition.errors import PlaceRecognitionError

_log = logging.getLogger(__name__)
_LARGEST_BYTES = 64 * MIB


def cache_folder() -> Path:
    """Return the cache folder by the XDG base directory specification; it may not exist."""
    base = os.environ.get('XDG_CACHE_HOME', '')
    # Relative paths are ignored, as the specification requires.
    root = Path(base) if os.path.isabs(base) else Path.home() / '.cache'
    return root / 'hdc_place_recognition'


def cached(stem: str, suffix: str, sha256: str, make: Callable[[], bytes]) -> bytes:
    """
    Return a generated content, from the cache folder if it is there.

    A file is used only if it is the content that belongs here: `sha256` is its hash. Anybody who
    can write to the folder could otherwise put another network there. If the folder is not
    writable, the content is generated at every start and stays in memory.

    :param stem: start of the file name; names what the content is made from.
    :param suffix: end of the file name, with the dot.
    :param sha256: SHA-256 hash of the content, hexadecimal.
    :param make: generates the content.
    """
    path = _path(stem, suffix, sha256)
    content = None if path is None else _read(path, sha256)
    if content is None:
        content = make()
        if hashlib.sha256(content).hexdigest() != sha256:
            _log.info('%s differs from the one that is stored in the cache: not stored', stem)
        elif path is not None:
            _write(path, content)
    return content


def _path(stem: str, suffix: str, sha256: str) -> Path | None:
    """Return the path of a cached file, None if the user has no home folder."""
    try:
        return cache_folder() / f'{stem}-{sha256[:16]}{suffix}'
    except RuntimeError as error:
        _log.warning('there is no cache, %s is generated at every start: %s', stem, error)
        return None


def _read(path: Path, sha256: str) -> bytes | None:
    """Return the content of a file; None if it is missing or not the right one."""
    if not os.path.lexists(path):
        return None
    try:
        content = read_bounded(path, _LARGEST_BYTES, 'cached file')
    except PlaceRecognitionError as error:
        _log.warning('%s; it is generated again', error)
        return None
    if hashlib.sha256(content).hexdigest() != sha256:
        _log.warning('cached file %s is damaged or foreign and is generated again', path)
        return None
    return content


def _write(path: Path, content: bytes) -> None:
    """Write the file atomically and only for the user: nobody sees an incomplete file."""
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        # Files of tempfile have the permissions 0600.
        with tempfile.TemporaryDirectory(dir=path.parent) as scratch:
            descriptor, name = tempfile.mkstemp(dir=scratch)
            with os.fdopen(descriptor, 'wb') as file:
                file.write(content)
                file.flush()
                os.fsync(descriptor)
            os.replace(name, path)
    except (OSError, RuntimeError) as error:
        _log.warning(
            'the cache cannot be written, %s is generated at every start: %s', path.name, error
        )
