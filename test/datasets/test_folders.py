# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Image folders, and the dataset that each kind of input gives."""

import os

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


# --- Names and files as cameras and people leave them


def named(folder, *names):
    """Write an image of one value for each name; return the folder."""
    folder.mkdir(parents=True)
    for value, name in enumerate(names):
        cv2.imwrite(str(folder / name), np.full((16, 16), 10 * value, np.uint8))
    return folder


def test_numbers_without_padding_are_in_natural_order(tmp_path, caplog):
    folder = named(tmp_path / 'images', '10.png', '9.png', '1.png', 'B2.png', 'a10.png', 'b1.PNG')
    names = [file.name for file in FolderImages.from_folder(folder).files]
    assert names == ['1.png', '9.png', '10.png', 'a10.png', 'b1.PNG', 'B2.png']
    assert 'in the order of the numbers in their names, 9.png before 10.png' in caplog.text


def test_padded_numbers_need_no_warning(tmp_path, caplog):
    FolderImages.from_folder(named(tmp_path / 'images', '0001.png', '0002.png', '0010.png'))
    assert not caplog.records


def test_an_ambiguous_order_is_logged(tmp_path, caplog):
    FolderImages.from_folder(named(tmp_path / 'images', '1.png', '01.png', '2.png'))
    assert 'the order of 01.png and 1.png is ambiguous' in caplog.text


@pytest.mark.parametrize('suffix', ['.webp', '.tif', '.tiff', '.bmp', '.pgm', '.jp2', '.WebP'])
def test_other_formats(tmp_path, suffix):
    if not cv2.haveImageWriter('image' + suffix.lower()):
        pytest.skip(f'OpenCV writes no {suffix}')
    (tmp_path / 'images').mkdir()
    image = np.repeat(np.arange(0, 256, 4, dtype=np.uint8)[:, None], 64, axis=1)
    data = cv2.imencode(suffix.lower(), image)[1]
    (tmp_path / 'images' / f'0{suffix}').write_bytes(data.tobytes())
    (frame,) = FolderImages.from_folder(tmp_path / 'images')
    gray = frame.image if frame.image.ndim == 2 else frame.image[..., 0]
    assert np.abs(gray.astype(int) - image).mean() < 6


def test_what_is_left_out_is_logged(tmp_path, caplog):
    caplog.set_level('INFO')
    folder = named(tmp_path / 'images', '0.png')
    for name in ('._0.png', 'a.txt', 'b.heic', 'c.avi', 'd.raw'):
        (folder / name).write_text('x')
    (folder / 'e.png').mkdir()
    os.mkfifo(folder / 'f.jpg')
    assert len(list(FolderImages.from_folder(folder))) == 1
    assert 'left out 1 hidden file: ._0.png' in caplog.text
    assert 'left out 6 files: a.txt, b.heic, c.avi, ...; read are regular' in caplog.text


def turned(image):
    """Return a JPEG that was taken upright: turned, with EXIF orientation 6."""
    data = cv2.imencode('.jpg', np.rot90(image))[1].tobytes()
    tiff = b'MM\0\x2a\0\0\0\x08' + b'\0\x01' + b'\x01\x12\0\x03\0\0\0\x01\0\x06\0\0' + bytes(4)
    exif = b'Exif\0\0' + tiff
    return data[:2] + b'\xff\xe1' + (len(exif) + 2).to_bytes(2, 'big') + exif + data[2:]


def test_the_exif_orientation_is_honored_unless_switched_off(tmp_path):
    (tmp_path / 'images').mkdir()
    image = np.zeros((32, 48), np.uint8)
    image[:8] = 255
    (tmp_path / 'images' / '0.jpg').write_bytes(turned(image))
    (frame,) = open_dataset(tmp_path).queries
    assert frame.image.shape == (32, 48)
    assert np.abs(frame.image.astype(int) - image).mean() < 3
    (frame,) = open_dataset(tmp_path, options=Options(exif_orientation=False)).queries
    assert frame.image.shape == (48, 32)


def test_images_that_are_too_large(tmp_path):
    named(tmp_path / 'images', '0.png')
    with pytest.raises(
        PlaceRecognitionError, match=r'0\.png: image of 16 x 16 has more than max_'
    ):
        list(open_dataset(tmp_path, options=Options(max_image_pixels=255)).queries)


def test_poses_with_yaw(tmp_path):
    write_images(tmp_path / 'images', 2)
    file = tmp_path / 'poses.csv'
    file.write_text(f'index, x, y, yaw\n0,1,2,0\n1,3,4,{np.pi / 2}\n')
    poses = read_poses(file)
    np.testing.assert_array_equal(poses.positions, [[1, 2, 0], [3, 4, 0]])
    np.testing.assert_allclose(poses.view_directions('x'), [[1, 0, 0], [0, 1, 0]], atol=1e-12)
    assert open_dataset(tmp_path).ground_truth.view_axis == 'x'
    assert open_dataset(tmp_path, options=Options(view_axis='z')).ground_truth.view_axis == 'z'


@pytest.mark.parametrize(
    ('content', 'reason'),
    [
        (b'index,x,y,yaw\n-1,0,0,0\n', 'line 2: .*index -1 is outside 0 to 1000000000'),
        (b'index,x,y,yaw\n0,0,0,0\n99999999999999999999,0,0,0\n', 'line 3: .*is outside'),
        (b'index,x,y,yaw\n' + b'9' * 5000 + b',0,0,0\n', 'line 2'),
        (b'index,x,y,yaw\n0,0,0,' + b'1' * 200_000, 'line 2: .*field larger than field limit'),
        (b'\xff\xfe\0', 'line 2: UnicodeDecodeError'),
        (b'index,x,y,yaw\n0,0,0,inf\n', 'no pose of finite numbers'),
        (b'', 'no pose of finite numbers'),
        (b'0' * (2**24 + 1), 'more than the limit of 16777216'),
    ],
    ids=['negative', 'large', 'digits', 'field', 'encoding', 'infinite', 'empty', 'size'],
)
def test_hostile_poses_are_one_error(tmp_path, content, reason):
    file = tmp_path / 'poses.csv'
    file.write_bytes(content)
    with pytest.raises(PlaceRecognitionError, match=rf'poses\.csv.*{reason}'):
        read_poses(file)
