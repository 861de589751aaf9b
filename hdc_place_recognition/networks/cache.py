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

_log = logging.getLogger(__name__)


def cache_folder() -> Path:
    """Return the cache folder by the XDG base directory specification; it may not exist."""
    base = os.environ.get('XDG_CACHE_HOME', '')
    # Relative paths are ignored, as the specification requires.
    root = Path(base) if os.path.isabs(base) else Path.home() / '.cache'
    return root / 'hdc_place_recognition'


def cached(stem: str, suffix: str, make: Callable[[], bytes]) -> bytes:
    """
    Return the content of a cached file; generate and store it if it does not exist.

    The file name is `<stem>-<hash of the content><suffix>`, so a damaged file is detected and
    generated again. If the folder is not writable, the content is generated at every call.

    :param stem: start of the file name; must depend on everything that determines the content.
    :param suffix: end of the file name, with the dot.
    :param make: generates the content.
    """
    content = _find(stem, suffix)
    if content is None:
        content = make()
        _keep(stem, suffix, content)
    return content


def _find(stem: str, suffix: str) -> bytes | None:
    """Return the content of the first file that is not damaged, None if there is none."""
    try:
        for path in sorted(cache_folder().glob(f'{stem}-*{suffix}')):
            content = path.read_bytes()
            if path.name == _name(stem, suffix, content):
                return content
            _log.warning('%s is damaged and is generated again', path)
    except (OSError, RuntimeError) as error:
        _log.warning('the cache cannot be read: %s', error)
    return None


def _keep(stem: str, suffix: str, content: bytes) -> None:
    """Write the file atomically: other processes never see an incomplete file."""
    try:
        folder = cache_folder()
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            path = Path(scratch, 'content')
            path.write_bytes(content)
            os.replace(path, folder / _name(stem, suffix, content))
    except (OSError, RuntimeError) as error:
        _log.warning(
            'the cache cannot be written, %s is generated at every start: %s', stem, error
        )


def _name(stem: str, suffix: str, content: bytes) -> str:
    """Return the file name of a content."""
    return f'{stem}-{hashlib.sha256(content).hexdigest()[:16]}{suffix}'
