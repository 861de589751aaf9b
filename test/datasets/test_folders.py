# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Image folders, and the dataset that each kind of input gives."""

import cv2
from hdc_place_recognition.datasets.dataset import Mode
from hdc_place_recognition.datasets.folders import FolderImages, read_image, read_poses
from hdc_place_recognition.datasets.ground_truth import MatrixTruth, PoseTruth
from hdc_place_recognition.datasets.open_dataset import open_dataset, Options
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
import pytest

S = 10**9
POSES = 'index,stamp,x,y,z,qx,qy,qz,qw\n'


def write_images(folder, count):
    """Write gray images with sortable names; all pixels of image n have the value n."""
    folder.mkdir(parents=True)
    for index in range(count):
        cv2.imwrite(str(folder / f'{index:04d}.png'), np.full((4, 6), index, np.uint8))


def write_gt(folder, queries, database, min_gap):
    shape = (queries, database)
    np.savez(folder / 'gt.npz', hard=np.eye(*shape), soft=np.ones(shape), min_gap=min_gap)


def test_images_in_sorted_order_one_second_apart(tmp_path):
    write_images(tmp_path / 'images', 3)
    (tmp_path / 'images' / 'notes.txt').write_text('no image')
    cv2.imwrite(str(tmp_path / 'images' / '0000a.JPG'), np.full((4, 6, 3), 200, np.uint8))
    images = FolderImages.from_folder(tmp_path / 'images')
    assert len(images) == 4
    frames = list(images)
    assert (
        [frame.stamp_ns for frame in frames] == [0, S, 2 * S, 3 * S] == images.stamps_ns.tolist()
    )
    assert [int(frame.image.min()) for frame in frames] == [0, 200, 1, 2]
    assert [frame.image.ndim for frame in frames] == [2, 3, 2, 2]


def test_color_is_bgr_and_16_bits_become_8(tmp_path):
    color = np.zeros((2, 2, 3), np.uint8)
    color[..., 0] = 255
    cv2.imwrite(str(tmp_path / 'blue.png'), color)
    cv2.imwrite(str(tmp_path / 'deep.png'), np.array([[0, 65535]], np.uint16))
    np.testing.assert_array_equal(read_image(tmp_path / 'blue.png'), color)
    assert read_image(tmp_path / 'deep.png').tolist() == [[0, 255]]


@pytest.mark.parametrize('content', [b'', b'hello', 'cut'], ids=['empty', 'text', 'cut'])
def test_image_that_does_not_decode_is_named(tmp_path, content):
    write_images(tmp_path / 'images', 2)
    file = tmp_path / 'images' / '0001.png'
    if content == 'cut':
        file = file.with_suffix('.jpg')
        noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
        cv2.imwrite(str(file), noise)
        content = file.read_bytes()[:-3000]
    file.write_bytes(content)
    with pytest.raises(PlaceRecognitionError, match=rf'image .*{file.name}: .*replace it'):
        list(FolderImages.from_folder(tmp_path / 'images'))


def test_no_images(tmp_path):
    (tmp_path / 'images').mkdir()
    with pytest.raises(PlaceRecognitionError, match=r'images holds no \.jpg'):
        open_dataset(tmp_path)


def test_poses_by_index_of_the_image(tmp_path):
    file = tmp_path / 'poses.csv'
    file.write_text(POSES + '2,1305031452.9,1,2,3,0,0,0,1\n0,1305031452.7,4,5,6,0,0,1,0\n')
    poses = read_poses(file)
    assert poses.stamps_ns.tolist() == [0, 2 * S]
    assert poses.positions.tolist() == [[4, 5, 6], [1, 2, 3]]
    assert poses.quaternions.tolist() == [[0, 0, 1, 0], [0, 0, 0, 1]]


@pytest.mark.parametrize(
    'text',
    [POSES + '0,0,x,0,0,0,0,0,1\n', POSES + '0,0,1\n', 'index,x,y,z\n0,1,2,3\n'],
    ids=['no number', 'short line', 'missing columns'],
)
def test_bad_poses_name_the_line(tmp_path, text):
    file = tmp_path / 'poses.csv'
    file.write_text(text)
    with pytest.raises(PlaceRecognitionError, match=r'poses\.csv, line 2: .*index, x, y, z, qx'):
        read_poses(file)


def test_min_gap_sets_the_minimum_age_of_candidates(tmp_path):
    write_images(tmp_path / 'images', 3)
    write_gt(tmp_path, 3, 3, min_gap=2)
    dataset = open_dataset(tmp_path)
    assert dataset.mode is Mode.SEQUENCE
    assert dataset.name == tmp_path.name
    assert dataset.overrides == {
        'min_interval_s': 0.0,
        'keyframe_similarity': 1.0,
        'exact': True,
        'exclude_recent_s': 2.0,
        'exclude_recent_frames': 0,
    }
    assert isinstance(dataset.ground_truth, MatrixTruth)


def test_retrieval(tmp_path):
    write_images(tmp_path / 'images', 3)
    write_gt(tmp_path, 3, 3, min_gap=-1)
    assert open_dataset(tmp_path).mode is Mode.RETRIEVAL


def test_two_traverses_in_one_folder(tmp_path):
    write_images(tmp_path / 'images' / 'ref', 3)
    write_images(tmp_path / 'images' / 'query', 2)
    write_gt(tmp_path, 2, 3, min_gap=-1)
    dataset = open_dataset(tmp_path)
    assert dataset.mode is Mode.TRAVERSES
    assert (len(dataset.queries), len(dataset.reference)) == (2, 3)
    truth = dataset.ground_truth.truth(dataset.queries.stamps_ns, dataset.reference.stamps_ns)
    assert truth.hard.tolist() == [[True, False, False], [False, True, False]]


def test_transposed_ground_truth(tmp_path):
    write_images(tmp_path / 'images' / 'ref', 3)
    write_images(tmp_path / 'images' / 'query', 2)
    write_gt(tmp_path, 3, 2, min_gap=-1)
    with pytest.raises(
        PlaceRecognitionError, match=r'shape \(3, 2\), but the images are \(2, 3\)'
    ):
        open_dataset(tmp_path)


def test_reference_without_queries(tmp_path):
    write_images(tmp_path / 'images' / 'ref', 3)
    with pytest.raises(PlaceRecognitionError, match=r'images holds no \.jpg'):
        open_dataset(tmp_path)


def test_two_folders(tmp_path):
    for name, x in (('map', 0), ('drive', 3)):
        write_images(tmp_path / name / 'images', 2)
        (tmp_path / name / 'poses.csv').write_text(
            POSES + f'0,0,{x},0,0,0,0,0,1\n1,0,99,{x},0,0,0,0,1\n'
        )
    dataset = open_dataset(tmp_path / 'drive', tmp_path / 'map', Options(radius_m=2.0))
    assert dataset.mode is Mode.TRAVERSES
    stamps = np.array([0, S])
    truth = dataset.ground_truth.truth(stamps, stamps)
    assert not truth.hard.any()  # 3 m apart
    assert truth.soft.tolist() == [[True, False], [False, True]]


def test_poses_are_ground_truth_where_there_is_no_matrix(tmp_path):
    write_images(tmp_path / 'images', 2)
    (tmp_path / 'poses.csv').write_text(POSES + '0,0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,0,1\n')
    dataset = open_dataset(tmp_path)
    assert isinstance(dataset.ground_truth, PoseTruth)
    assert dataset.ground_truth.view_axis == 'z'
    assert 'poses within 5 m and 45 deg' in dataset.ground_truth.summary
    assert dataset.overrides == {
        'min_interval_s': 0.0,
        'keyframe_similarity': 1.0,
        'exact': True,
    }
    write_gt(tmp_path, 2, 2, min_gap=0)
    assert isinstance(open_dataset(tmp_path).ground_truth, MatrixTruth)


def test_without_ground_truth(tmp_path):
    write_images(tmp_path / 'images', 2)
    dataset = open_dataset(tmp_path)
    assert dataset.mode is Mode.SEQUENCE
    assert dataset.ground_truth is None


def test_missing_input(tmp_path):
    with pytest.raises(PlaceRecognitionError, match='nowhere does not exist'):
        open_dataset(tmp_path / 'nowhere')


def test_neither_bag_nor_images(tmp_path):
    with pytest.raises(PlaceRecognitionError, match=r'neither a folder of images.*nor a bag'):
        open_dataset(tmp_path)


@pytest.mark.parametrize(
    ('name', 'mode'),
    [
        ('lip6_outdoor_part1', Mode.SEQUENCE),
        ('planetarium_12_sessions', Mode.RETRIEVAL),
        ('rtabmap_corridor_2laps', Mode.SEQUENCE),
        ('stromovka_part1', Mode.TRAVERSES),
        ('tum_fr1_desk', Mode.SEQUENCE),
    ],
)
def test_a_development_set_opens(shared_data, name, mode):
    folder = shared_data / name
    if not folder.is_dir():
        pytest.skip(f'no {folder}')
    assert open_dataset(folder).mode is mode
