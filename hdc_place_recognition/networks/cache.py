# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Files that are made once and kept in the user's cache folder."""

from __future__ import annotations

from collections.abc import Callable
import hashlib
import logging
import os
from pathlib import Path
import tempfile

_log = logging.getLogger(__name__)


def cache_folder() -> Path:
    """Return the folder, whether it exists or not: after the XDG base directory specification."""
    base = os.environ.get('XDG_CACHE_HOME', '')
    # The specification wants relative paths ignored.
    root = Path(base) if os.path.isabs(base) else Path.home() / '.cache'
    return root / 'hdc_place_recognition'


def cached(stem: str, suffix: str, make: Callable[[], bytes]) -> bytes:
    """
    Return the content kept as `stem` and `suffix`; make and keep it if there is none.

    The file's name carries the content's hash between the two, so that a damaged file is known
    and made again. Where the folder cannot be written, the content is made every time.

    :param stem: start of the file's name: says all that the content depends on.
    :param suffix: end of the file's name, with its dot.
    :param make: returns the content.
    """
    content = _find(stem, suffix)
    if content is None:
        content = make()
        _keep(stem, suffix, content)
    return content


def _find(stem: str, suffix: str) -> bytes | None:
    """Return the content of the first undamaged file, None if there is none."""
    try:
        for path in sorted(cache_folder().glob(f'{stem}-*{suffix}')):
            content = path.read_bytes()
            if path.name == _name(stem, suffix, content):
                return content
            _log.warning('%s is damaged, it is made again', path)
    except (OSError, RuntimeError) as error:
        _log.warning('the cache cannot be read: %s', error)
    return None


def _keep(stem: str, suffix: str, content: bytes) -> None:
    """Write the file at once or not at all, so that no other process sees a part of it."""
    try:
        folder = cache_folder()
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            path = Path(scratch, 'content')
            path.write_bytes(content)
            os.replace(path, folder / _name(stem, suffix, content))
    except (OSError, RuntimeError) as error:
        _log.warning('the cache cannot be written, %s is made at every start: %s', stem, error)


def _name(stem: str, suffix: str, content: bytes) -> str:
    return f'{stem}-{hashlib.sha256(content).hexdigest()[:16]}{suffix}'
