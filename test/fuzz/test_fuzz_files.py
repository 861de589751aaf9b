# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Any file is read or gives one error: parameters, ground truth, poses, bags, weights, cache."""

from collections import OrderedDict
import hashlib
from io import BytesIO
from pathlib import Path
import pickle
import shutil
import struct
import tempfile
import zipfile

from bag_messages import CAMERA, image, odometry, S, START, STORE1, write_bag
from hdc_place_recognition.datasets import bags
from hdc_place_recognition.datasets.bag_files import open_bag
from hdc_place_recognition.datasets.folders import has_yaw, read_poses
from hdc_place_recognition.datasets.ground_truth import load_matrices
from hdc_place_recognition.networks import cache, weights
from hdc_place_recognition.params.formats import dump_yaml, load_yaml
from hdc_place_recognition.params.table import Params
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores
from test_fuzz_images import damaged


@pytest.fixture(scope='module')
def scratch():
    """Return a folder in memory if there is one: it is written for every input."""
    memory = Path('/dev/shm')
    folder = tempfile.mkdtemp(dir=memory if memory.is_dir() else None)
    yield Path(folder)
    shutil.rmtree(folder)


YAML_PARTS = [
    '/**:\n', 'place_recognition_node:\n', '  ros__parameters:\n', '    min_score: 0.5\n',
    '    n_x: ',
    '[', ']', '{', '}', '&a ', '*a', '? ', ': ', '- ', '!!python/object:os.system ', '!!int ',
    '!!binary ', '!!timestamp ', '"', "'", '|\n', '>\n', '<<: ', '\n', '  ', '#', '1e999', '1:1:1',
    '0x', '2026-99-99', '.nan', '%YAML 9.9\n', '---\n', '...\n', '\x00', '\xff', '\ufeff',
    '9' * 5000,
]  # fmt: skip
YAML = st.one_of(
    st.lists(st.sampled_from(YAML_PARTS), max_size=25).map(lambda parts: ''.join(parts).encode()),
    damaged(dump_yaml(Params()).encode()[:700]),
    st.binary(max_size=80),
)


@given(content=YAML)
def test_params_yaml(target, scratch, content):
    file = scratch / 'params.yaml'
    file.write_bytes(content)
    values = target(load_yaml, file)
    if values is not None:
        target(Params.from_dict, {str(name): value for name, value in values.items()})


CELLS = st.one_of(
    st.floats().map(str),
    st.integers(-5, 5).map(str),
    st.integers().map(str),
    st.text(max_size=5),
    st.sampled_from(['', 'nan', 'inf', '1e999', '"', '9' * 5000, '\x00', '0x1']),
)
COLUMNS = ['index', 'x', 'y', 'z', 'qx', 'qy', 'qz', 'qw', 'yaw', '', ' x', 'stamp']
ROWS = st.lists(st.lists(CELLS, max_size=10).map(','.join), max_size=5)
TABLES = st.one_of(
    st.tuples(st.lists(st.sampled_from(COLUMNS), max_size=10).map(','.join), ROWS),
    st.tuples(st.just('index,x,y,z,qx,qy,qz,qw'), ROWS),
    st.tuples(st.just('index,x,y,yaw'), ROWS),
).map(lambda table: '\n'.join([table[0], *table[1]]).encode('utf-8', 'surrogatepass'))


@given(content=st.one_of(TABLES, st.binary(max_size=80)))
def test_poses_csv(target, scratch, content):
    file = scratch / 'poses.csv'
    file.write_bytes(content)
    poses = target(read_poses, file)
    has_yaw(file)
    if poses is not None:
        assert np.isfinite(poses.positions).all()
        target(poses.view_directions, 'z')


def ground_truth(compressed):
    """Return the content of a gt.npz file of 3 x 2 images."""
    content = BytesIO()
    save = np.savez_compressed if compressed else np.savez
    save(content, hard=np.eye(3, 2, dtype=bool), soft=np.ones((3, 2)), min_gap=5)
    return content.getvalue()


def archive(members):
    content = BytesIO()
    with zipfile.ZipFile(content, 'w') as file:
        for name, member in members.items():
            file.writestr(f'{name}.npy', member)
    return content.getvalue()


def npy(descr, shape, data, version):
    header = f"{{'descr': {descr!r}, 'fortran_order': False, 'shape': {shape!r}, }}".encode()
    return b'\x93NUMPY' + bytes([version, 0]) + struct.pack('<H', len(header)) + header + data


ARRAYS = st.builds(
    npy,
    st.sampled_from(
        ['|b1', '<i8', '>f4', '<f2', '|O', '<U9', '|V900000000', '<c8', [('a', '<i4')]]
    ),
    st.one_of(st.sampled_from([(3, 2), (), (1,)]), st.lists(st.integers(-2, 2**40)).map(tuple)),
    st.binary(max_size=60),
    st.integers(0, 4),
)
ARCHIVES = st.one_of(
    damaged(ground_truth(compressed=False)),
    damaged(ground_truth(compressed=True)),
    st.fixed_dictionaries(dict.fromkeys(('hard', 'soft', 'min_gap'), ARRAYS)).map(archive),
    st.binary(max_size=80),
)


@given(content=ARCHIVES)
def test_ground_truth_npz(target, scratch, content):
    file = scratch / 'gt.npz'
    file.write_bytes(content)
    found = target(load_matrices, file, 3, 2)
    if found is not None:
        assert found[0].hard.shape == (3, 2)


def bag_contents():
    """Return the storage files of small bags of every format, by name."""
    contents = {}
    with tempfile.TemporaryDirectory() as folder:
        drive = [(CAMERA, image(START + n * S)) for n in range(3)]
        drive += [('/odom', odometry(START + n * S, 1.0)) for n in range(3)]
        for plugin in StoragePlugin:
            bag = write_bag(Path(folder, plugin.name), drive, plugin)
            (file,) = (path for path in bag.iterdir() if path.suffix != '.yaml')
            contents[f'drive{file.suffix}'] = file.read_bytes()
        contents['metadata.yaml'] = (bag / 'metadata.yaml').read_bytes()
        store = get_typestore(Stores.ROS2_JAZZY)
        for mode in (CompressionMode.FILE, CompressionMode.STORAGE):
            writer = Writer(Path(folder, mode.name), version=9, storage_plugin=StoragePlugin.MCAP)
            writer.set_compression(mode, CompressionFormat.ZSTD)
            with writer:
                connection = writer.add_connection(
                    CAMERA, 'sensor_msgs/msg/Image', typestore=store
                )
                data = store.serialize_cdr(image(START), 'sensor_msgs/msg/Image')
                writer.write(connection, START, data)
            (file,) = (
                path for path in Path(folder, mode.name).iterdir() if path.suffix != '.yaml'
            )
            contents[f'{mode.name}{file.suffix}'] = file.read_bytes()
        ros1 = Path(folder, 'old.bag')
        with Writer1(ros1) as old:
            kind = 'sensor_msgs/msg/Image'
            connection = old.add_connection(CAMERA, kind, typestore=STORE1)
            sent = image(START, store=STORE1)
            old.write(connection, START, STORE1.serialize_ros1(sent, kind))
        contents['old.bag'] = ros1.read_bytes()
    return contents


BAGS = bag_contents()


@pytest.mark.parametrize('name', [name for name in BAGS if name != 'metadata.yaml'])
@given(data=st.data())
def test_bag_file(target, scratch, name, data):
    file = scratch / name
    file.write_bytes(data.draw(damaged(BAGS[name])))
    target(read_bag, file)


def read_bag(path):
    """Read images and odometry of a bag."""
    frames = list(bags.BagImages.from_bag(path, CAMERA, skip_bad=True))
    if path.stem in ('drive', 'MCAP'):
        bags.read_poses(path, '/odom')
    return frames


@given(metadata=st.one_of(damaged(BAGS['metadata.yaml']), YAML))
def test_bag_metadata(target, scratch, metadata):
    folder = scratch / 'MCAP'
    folder.mkdir(exist_ok=True)
    (folder / 'MCAP.mcap').write_bytes(BAGS['drive.mcap'])
    (folder / 'metadata.yaml').write_bytes(metadata)
    target(read_bag, folder)


@given(
    content=st.one_of(
        st.binary(max_size=200), st.binary().map(lambda end: b'#ROSBAG V2.0\n' + end)
    )
)
def test_no_bag(target, scratch, content):
    file = scratch / 'drive.bag'
    file.write_bytes(content)
    target(list_topics, file)


def list_topics(path):
    with open_bag(path) as bag:
        return bag.topics


def legacy(size=6):
    """Return weights of one tensor in torch's legacy format."""
    parts = [0x1950A86A20F9469CFC6C, 1001, {}, OrderedDict(), ['0']]
    content = b''.join(pickle.dumps(part, 2) for part in parts)
    return content + struct.pack('<q', size) + bytes(4 * size)


LEGACY = legacy()
LEGACY_HASH = hashlib.sha256(LEGACY).hexdigest()


@given(content=damaged(LEGACY))
def test_weights(target, scratch, content):
    file = scratch / 'weights.pth'
    file.write_bytes(content)
    accepted = target(weights.read_checked, file, LEGACY_HASH)
    assert accepted in (None, LEGACY)
    if accepted is not None:
        target(weights.read_state, accepted)


@given(content=st.binary(max_size=40))
def test_cache(target, scratch, content):
    right = b'graph'
    digest = hashlib.sha256(right).hexdigest()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('XDG_CACHE_HOME', str(scratch))
        folder = scratch / 'hdc_place_recognition'
        folder.mkdir(exist_ok=True)
        (folder / f'net-{digest[:16]}.onnx').write_bytes(content)
        assert target(cache.cached, 'net', '.onnx', digest, lambda: right) == right
