# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Ground truth from poses and from matrices."""

import struct
from time import perf_counter
import zipfile

from hdc_place_recognition.datasets.dataset import Truth
from hdc_place_recognition.datasets.ground_truth import load_matrices, MatrixTruth, PoseTruth
from hdc_place_recognition.datasets.poses import match_poses, Poses
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
import pytest

S = 10**9
START = 1_776_863_762_100_071_637


def yaw(degrees):
    """Return the quaternion x y z w of a rotation to the left."""
    half = np.radians(degrees) / 2
    return [0.0, 0.0, np.sin(half), np.cos(half)]


def poses_at(*places, start=0):
    """Return poses from (x, y, yaw in degrees), one second apart."""
    rows = [[x, y, 0.0, *yaw(turn)] for x, y, turn in places]
    return Poses.from_rows([start + n * S for n in range(len(rows))], rows, 'test')


def truth_of(poses, *, radius_m=1.0, max_angle_deg=30.0, stamps_ns=None, view_axis='x'):
    ground_truth = PoseTruth(
        queries=poses,
        database=poses,
        radius_m=radius_m,
        max_angle_deg=max_angle_deg,
        view_axis=view_axis,
        tolerance_ns=S // 10,
    )
    stamps_ns = poses.stamps_ns if stamps_ns is None else np.array(stamps_ns, np.int64)
    return ground_truth.truth(stamps_ns, stamps_ns)


def test_hard_and_soft_by_distance():
    # Distances to the first pose: 0, 1 (the radius), 1.5, 2 (twice the radius), 2.5 m.
    poses = poses_at((0, 0, 0), (1, 0, 0), (0, 1.5, 0), (-2, 0, 0), (0, -2.5, 0))
    truth = truth_of(poses)
    assert truth.hard[0].tolist() == [True, True, False, False, False]
    assert truth.soft[0].tolist() == [True, True, True, True, False]


def test_hard_and_soft_by_angle():
    truth = truth_of(poses_at((0, 0, 0), (0, 0, 29), (0, 0, -31), (0, 0, 59), (0, 0, 61)))
    assert truth.hard[0].tolist() == [True, True, False, False, False]
    assert truth.soft[0].tolist() == [True, True, True, True, False]


def test_angle_across_the_turn_of_180_degrees():
    truth = truth_of(poses_at((0, 0, 170), (0, 0, -170), (0, 0, 0)))
    assert truth.hard[0].tolist() == [True, True, False]


def test_truth_is_symmetric_and_hard_pairs_are_soft():
    rng = np.random.default_rng(0)
    truth = truth_of(poses_at(*(rng.random((30, 3)) * [5, 5, 360])))
    assert (truth.hard == truth.hard.T).all() and (truth.soft == truth.soft.T).all()
    assert truth.soft[truth.hard].all() and truth.hard.diagonal().all()
    assert 0 < truth.hard.sum() < truth.soft.sum() < truth.soft.size


def test_optical_frame_looks_along_z():
    # A rotation of 90 degrees about x changes the z axis, but not the x axis.
    quarter = [np.sin(np.pi / 4), 0, 0, np.cos(np.pi / 4)]
    rows = [[0, 0, 0, 0, 0, 0, 1.0], [0, 0, 0, *quarter]]
    poses = Poses.from_rows([0, S], rows, 'test')
    assert truth_of(poses, view_axis='x').hard.all()
    assert not truth_of(poses, view_axis='z').hard[0, 1]
    np.testing.assert_allclose(poses.view_directions('z')[1], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(poses_at((0, 0, 90)).view_directions('x'), [[0, 1, 0]], atol=1e-12)


def test_quaternions_need_not_have_unit_length():
    rows = [[0, 0, 0, *yaw(40)], [0, 0, 0, *(7 * np.array(yaw(40)))]]
    directions = Poses.from_rows([0, S], rows, 'test').view_directions('x')
    np.testing.assert_allclose(directions[0], directions[1])


def test_orientation_of_zeros():
    poses = Poses.from_rows([0, S], [[0, 0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 1]], 'test')
    with pytest.raises(PlaceRecognitionError, match=r'0 0 0 0.*--max-angle 180'):
        truth_of(poses)
    assert truth_of(poses, max_angle_deg=180).hard.all()


def test_pairs_of_an_image_without_pose_are_ignored():
    poses = poses_at((0, 0, 0), (0, 0, 0), (9, 0, 0))
    truth = truth_of(poses, stamps_ns=[0, S // 2, S, 2 * S])
    assert truth.hard[0].tolist() == [True, False, True, False]
    assert truth.soft[0].tolist() == [True, True, True, False]
    assert truth.soft[1].all() and not truth.hard[1].any()


def test_queries_and_database_of_two_traverses():
    ground_truth = PoseTruth(
        queries=poses_at((0.5, 0, 0), start=START),
        database=poses_at((0, 0, 0), (5, 0, 0)),
        radius_m=1.0,
        max_angle_deg=45.0,
        view_axis='x',
        tolerance_ns=0,
    )
    truth = ground_truth.truth(np.array([START]), np.array([0, S]))
    assert truth.hard.tolist() == [[True, False]]


def test_nearest_pose_within_the_tolerance(caplog):
    caplog.set_level('INFO')
    poses = poses_at((0, 0, 0), (1, 0, 0), (2, 0, 0), start=START)
    stamps = START + np.array([-60_000_000, 40_000_000, 960_000_000, 1_500_000_000, 2 * S])
    # 60 ms before pose 0; 40 ms after pose 0; 40 ms before pose 1; between poses; at pose 2.
    assert match_poses(poses, stamps, 50_000_000).tolist() == [-1, 0, 1, -1, 2]
    assert caplog.messages == ['poses for 3 of 5 images (max. gap 0.04 s)']


def test_stamps_are_compared_as_exact_integers():
    poses = poses_at((0, 0, 0), start=START)
    assert match_poses(poses, np.array([START + 1]), 1).tolist() == [0]
    with pytest.raises(PlaceRecognitionError, match='poses for only 0 of 1 images'):
        match_poses(poses, np.array([START + 2]), 1)


def test_too_few_poses():
    stamps = np.array([0, 5 * S, 6 * S])
    with pytest.raises(
        PlaceRecognitionError, match=r'only 1 of 3 images within 0\.1 s.*--odom-tolerance-s'
    ):
        match_poses(poses_at((0, 0, 0), (1, 0, 0)), stamps, S // 10)
    assert match_poses(poses_at((0, 0, 0)), np.array([0, 5 * S]), 0).tolist() == [0, -1]


def test_poses_are_sorted_and_the_last_pose_of_a_stamp_is_used(caplog):
    rows = [[x, 0, 0, 0, 0, 0, 1] for x in (3, 1, np.nan, 2, 4)]
    poses = Poses.from_rows([30, 10, 20, 20, 30], rows, 'bag x, topic /odom')
    assert poses.stamps_ns.tolist() == [10, 20, 30]
    assert poses.positions[:, 0].tolist() == [1, 2, 4]
    assert caplog.messages == ['bag x, topic /odom: dropped 1 of 5 poses that are not finite']


def test_no_poses_at_all():
    with pytest.raises(PlaceRecognitionError, match='topic /odom has no pose'):
        Poses.from_rows([], [], 'topic /odom')


def write_gt(file, hard_shape=(3, 2), soft_shape=(3, 2), min_gap=-1):
    np.savez(file, hard=np.zeros(hard_shape), soft=np.ones(soft_shape), min_gap=min_gap)
    return file


def test_matrices_are_read(tmp_path):
    hard = np.array([[1, 0], [0, 0], [0, 1]], np.uint8)
    soft = np.array([[1, 1], [0, 0], [0, 1]], np.uint8)
    np.savez(tmp_path / 'gt.npz', hard=hard, soft=soft, min_gap=np.int32(7), published=hard)
    truth, min_gap = load_matrices(tmp_path / 'gt.npz', 3, 2)
    assert min_gap == 7
    assert truth.hard.dtype == truth.soft.dtype == np.bool_
    np.testing.assert_array_equal(truth.hard, hard)
    np.testing.assert_array_equal(truth.soft, soft)


def test_part_of_a_matrix():
    matrices = Truth(np.arange(12).reshape(3, 4) == 6, np.arange(12).reshape(3, 4) > 5)
    given = MatrixTruth(matrices, np.arange(3) * S, np.arange(4) * S)
    part = given.truth(np.array([S, 2 * S]), np.array([0, 2 * S, 3 * S]))
    assert part.hard.tolist() == [[False, True, False], [False, False, False]]
    assert part.soft.tolist() == [[False, True, True], [True, True, True]]


@pytest.mark.parametrize('name', ['hard', 'soft'])
def test_wrong_shape_error_names_both_shapes(tmp_path, name):
    file = write_gt(tmp_path / 'gt.npz', **{f'{name}_shape': (2, 3)})
    with pytest.raises(
        PlaceRecognitionError, match=rf'gt\.npz: {name} has shape \(2, 3\).*\(3, 2\).*row'
    ):
        load_matrices(file, 3, 2)


def test_min_gap_must_be_one_number(tmp_path):
    file = write_gt(tmp_path / 'gt.npz', min_gap=[1, 2])
    with pytest.raises(PlaceRecognitionError, match=r'min_gap has shape \(2,\)'):
        load_matrices(file, 3, 2)


def test_missing_array(tmp_path):
    np.savez(tmp_path / 'gt.npz', hard=np.zeros((3, 2)), soft=np.zeros((3, 2)))
    with pytest.raises(PlaceRecognitionError, match=r'min_gap.*it needs the arrays hard, soft'):
        load_matrices(tmp_path / 'gt.npz', 3, 2)


@pytest.mark.parametrize('damage', ['empty', 'text', 'truncated', 'array', 'pickle', 'missing'])
def test_damaged_file(tmp_path, damage):
    file = write_gt(tmp_path / 'gt.npz')
    if damage == 'array':
        with file.open('wb') as stream:
            np.save(stream, np.zeros((3, 2)))
    elif damage == 'pickle':
        np.savez(file, hard=np.array([{}], object), soft=np.zeros((3, 2)), min_gap=0)
    elif damage == 'missing':
        file.unlink()
    else:
        data = file.read_bytes()
        file.write_bytes({'empty': b'', 'text': b'hard', 'truncated': data[:-40]}[damage])
    with pytest.raises(
        PlaceRecognitionError, match=r'gt\.npz (is not a readable npz|cannot be read)'
    ) as caught:
        load_matrices(file, 3, 2)
    assert '\n' not in str(caught.value)


def npz(path, **members):
    """Write an npz file from the raw content of its members."""
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(f'{name}.npy', content)
    return path


def npy(shape, descr='|b1', content=b'', version=b'\x01\x00', size='<H'):
    """Return a npy file with a header that may be a lie."""
    header = repr({'descr': descr, 'fortran_order': False, 'shape': shape}).encode()
    return b'\x93NUMPY' + version + struct.pack(size, len(header)) + header + content


GAP = npy((), '<i8', bytes(8))
LIES = {
    'a shape of gigabytes': (npy((100_000, 100_000)), r'hard has shape \(100000, 100000\)'),
    'the right shape without content': (npy((3, 2), '<f8'), 'not a readable npz'),
    'an item of gigabytes': (npy((3, 2), '|V2000000000'), 'hard holds .*not numbers'),
    'text': (npy((3, 2), '<U6', bytes(144)), 'hard holds <U6, not numbers'),
    'objects': (npy((3, 2), '|O', bytes(48)), 'hard holds object, not numbers'),
    'a header of gigabytes': (
        npy((3, 2), version=b'\x02\x00', size='<I')[:8] + b'\xff\xff\xff\xff',
        'not a readable npz',
    ),
    'a bomb': (npy((3, 2), content=bytes(2**26)), ''),
    'an unknown version': (npy((3, 2), version=b'\x09\x00'), 'npy format .9, 0. is not supp'),
    'deep brackets': (npy((3, 2)).replace(b'(3, 2)', b'(' * 5000), 'not a readable npz'),
}


@pytest.mark.parametrize('lie', LIES)
def test_a_hostile_file_is_one_error_at_once(tmp_path, lie):
    hard, reason = LIES[lie]
    file = npz(tmp_path / 'gt.npz', hard=hard, soft=npy((3, 2), content=bytes(6)), min_gap=GAP)
    start = perf_counter()
    if reason:
        with pytest.raises(PlaceRecognitionError, match=rf'gt\.npz.*{reason}') as caught:
            load_matrices(file, 3, 2)
        assert '\n' not in str(caught.value)
    else:
        assert not load_matrices(file, 3, 2)[0].hard.any()
    assert perf_counter() - start < 2


@pytest.mark.parametrize('gap', [np.nan, np.inf])
def test_a_gap_that_is_no_number(tmp_path, gap):
    file = write_gt(tmp_path / 'gt.npz', min_gap=gap)
    with pytest.raises(PlaceRecognitionError, match='not a readable npz'):
        load_matrices(file, 3, 2)


@pytest.mark.parametrize('order', ['C', 'F'])
@pytest.mark.parametrize('dtype', ['bool', 'int32', '>f8', 'float16'])
def test_arrays_of_any_order_and_type(tmp_path, order, dtype):
    hard = np.array([[1, 0], [0, 1], [1, 1]], dtype, order=order)
    np.savez_compressed(tmp_path / 'gt.npz', hard=hard, soft=hard, min_gap=3)
    truth, min_gap = load_matrices(tmp_path / 'gt.npz', 3, 2)
    assert truth.hard.tolist() == [[True, False], [False, True], [True, True]]
    assert min_gap == 3
