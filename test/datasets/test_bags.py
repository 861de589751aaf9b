# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Images, poses and cameras from bags."""

import subprocess
import sys

from bag_messages import (
    CAMERA,
    camera_info,
    header,
    image,
    images_bag,
    odometry,
    path_message,
    pose_stamped,
    S,
    START,
    STORE,
    STORE1,
    write_bag,
)
from hdc_place_recognition.datasets import bags
from hdc_place_recognition.datasets.bag_reader import topics
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer


@pytest.mark.parametrize('plugin', list(StoragePlugin))
@pytest.mark.parametrize('bare', [False, True], ids=['folder', 'bare file'])
def test_images_and_exact_header_stamps(tmp_path, plugin, bare):
    stamps = [START, START + 1, START + S]
    bag = images_bag(tmp_path / 'bag', stamps, plugin)
    if bare:
        (bag,) = (file for file in bag.iterdir() if file.suffix in ('.db3', '.mcap'))
    images = bags.BagImages.from_bag(bag)
    assert images.topic == CAMERA
    assert len(images) == 3
    for _ in range(2):  # frames can be iterated again
        frames = list(images)
        assert [frame.stamp_ns for frame in frames] == stamps
        assert [frame.image.shape for frame in frames] == [(4, 6)] * 3
        assert [int(frame.image.min()) for frame in frames] == [0, 1, 2]


def test_ros1_bag(tmp_path):
    path = tmp_path / 'old.bag'
    kind = 'sensor_msgs/msg/Image'
    with Writer1(path) as writer:
        connection = writer.add_connection(CAMERA, kind, typestore=STORE1)
        message = image(START, 7, store=STORE1)
        writer.write(connection, 5 * S, STORE1.serialize_ros1(message, kind))
    (frame,) = bags.BagImages.from_bag(path)
    assert frame.stamp_ns == START
    assert (frame.image == 7).all()


def test_compressed_images(tmp_path):
    cv2 = pytest.importorskip('cv2')
    sent = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    message = STORE.types['sensor_msgs/msg/CompressedImage'](
        header=header(START),
        format='bgr8; png compressed bgr8',
        data=cv2.imencode('.png', sent)[1],
    )
    bag = write_bag(tmp_path / 'bag', [('/camera/image_raw/compressed', message)])
    (frame,) = bags.BagImages.from_bag(bag)
    np.testing.assert_array_equal(frame.image, sent)


def test_images_without_stamps_get_the_time_of_recording(tmp_path, caplog):
    bag = images_bag(tmp_path / 'bag', [0] * 4)
    with pytest.raises(PlaceRecognitionError, match=r'stamp is 0 again.*times of recording inst'):
        list(bags.BagImages.from_bag(bag))
    frames = list(bags.BagImages.from_bag(bag, skip_bad=True))
    assert len({frame.stamp_ns for frame in frames}) == 4 and frames[0].stamp_ns == 0
    assert caplog.text.count('the driver of the camera sets no stamps') == 1


def test_several_image_topics_are_listed_as_flags(tmp_path):
    bag = write_bag(tmp_path / 'bag', [('/right', image(1)), ('/left', image(2))])
    with pytest.raises(PlaceRecognitionError, match=r'use --topic /left \| --topic /right$'):
        bags.BagImages.from_bag(bag)
    with pytest.raises(PlaceRecognitionError, match=r'no .* topic /top; use --topic /left'):
        bags.BagImages.from_bag(bag, '/top')
    assert [frame.stamp_ns for frame in bags.BagImages.from_bag(bag, '/right')] == [1]


def test_no_image_topic(tmp_path):
    bag = write_bag(tmp_path / 'bag', [('/odom', odometry(START, 0.0))])
    with pytest.raises(PlaceRecognitionError, match='no topic of type Image or CompressedImage'):
        bags.BagImages.from_bag(bag)


def test_image_topic_without_messages(tmp_path):
    bag = write_bag(
        tmp_path / 'bag', [('/p', pose_stamped(1, 0.0))], empty=[(CAMERA, 'sensor_msgs/msg/Image')]
    )
    with pytest.raises(PlaceRecognitionError, match=f'topic {CAMERA} has no messages'):
        bags.BagImages.from_bag(bag)


def damaged(bag, how):
    """Damage the storage file of a bag; return the bag."""
    (file,) = (path for path in bag.iterdir() if path.suffix in ('.db3', '.mcap'))
    data = file.read_bytes()
    if how == 'empty':
        file.write_bytes(b'')
    elif how == 'truncated':
        file.write_bytes(data[: len(data) // 2])
    elif how == 'garbage':
        file.write_bytes(b'\x5a' * len(data))
    elif how == 'missing':
        file.unlink()
    return bag


@pytest.mark.parametrize('plugin', list(StoragePlugin))
@pytest.mark.parametrize('how', ['empty', 'truncated', 'garbage', 'missing'])
@pytest.mark.parametrize('bare', [False, True], ids=['folder', 'bare file'])
def test_damaged_bag_is_one_line(tmp_path, plugin, how, bare):
    bag = images_bag(tmp_path / 'bag', [n * S for n in range(1, 500)], plugin)
    (file,) = (path for path in bag.iterdir() if path.suffix in ('.db3', '.mcap'))
    damaged(bag, how)
    path = file if bare else bag
    with pytest.raises(PlaceRecognitionError, match=r'cannot be read|has no topic') as caught:
        list(bags.BagImages.from_bag(path))
    assert str(path) in str(caught.value)
    assert '\n' not in str(caught.value)


def test_damaged_pages_in_the_middle_give_one_line(tmp_path):
    bag = images_bag(tmp_path / 'bag', [n * S for n in range(1, 500)])
    (file,) = bag.glob('*.db3')
    data = bytearray(file.read_bytes())
    middle = len(data) // 2 // 4096 * 4096
    end = middle + 4 * 4096
    data[middle:end] = b'\xff' * (end - middle)
    file.write_bytes(data)
    with pytest.raises(PlaceRecognitionError, match='cannot be read'):
        list(bags.BagImages.from_bag(bag))


@pytest.mark.parametrize('name', ['nothing', 'nothing.mcap', 'nothing.db3', 'nothing.bag'])
def test_missing_bag(tmp_path, name):
    with pytest.raises(PlaceRecognitionError, match=f'{name} cannot be read'):
        bags.BagImages.from_bag(tmp_path / name)


def test_a_text_file_is_not_a_bag(tmp_path):
    file = tmp_path / 'notes.txt'
    file.write_text('hello')
    with pytest.raises(PlaceRecognitionError, match='cannot be read'):
        bags.BagImages.from_bag(file)


@pytest.mark.parametrize('content', ['', 'a: [', 'rosbag2_bagfile_information: 3', '\x00'])
def test_bad_metadata(tmp_path, content):
    bag = images_bag(tmp_path / 'bag', [START])
    (bag / 'metadata.yaml').write_text(content)
    with pytest.raises(PlaceRecognitionError, match='cannot be read'):
        bags.BagImages.from_bag(bag)


def short_cdr(stamp_ns):
    return bytes(STORE.serialize_cdr(image(stamp_ns), 'sensor_msgs/msg/Image'))[:30]


BAD_MESSAGES = [
    pytest.param(
        image(START + 1, size=23), r'stamp \d+1638 ns: .*24 bytes.*23', 1, id='short data'
    ),
    pytest.param(
        short_cdr(START + 1), r'30 bytes are no sensor_msgs/msg/Image', 1, id='short cdr'
    ),
    pytest.param(image(START), f'stamp {START} ns repeats', 0, id='repeated'),
    pytest.param(image(START - 1), rf'{START - 1} ns goes back .* {START} ns', 0, id='goes back'),
]


@pytest.mark.parametrize('bad, reason, lost', BAD_MESSAGES)
def test_bad_message_error_has_number_and_remedy(tmp_path, bad, reason, lost):
    bag = write_bag(
        tmp_path / 'bag', [(CAMERA, image(START)), (CAMERA, bad), (CAMERA, image(START + S))]
    )
    with pytest.raises(PlaceRecognitionError, match=f'{CAMERA}, message 2.*{reason}') as caught:
        list(bags.BagImages.from_bag(bag))
    assert '--skip-bad' in str(caught.value)


@pytest.mark.parametrize('bad, reason, lost', BAD_MESSAGES)
def test_skip_bad_skips_and_counts_bad_messages(tmp_path, caplog, bad, reason, lost):
    bag = write_bag(
        tmp_path / 'bag', [(CAMERA, image(START)), (CAMERA, bad), (CAMERA, image(START + S))]
    )
    frames = list(bags.BagImages.from_bag(bag, skip_bad=True))
    # An image with a bad stamp is yielded; the recognizer skips it, as in the node.
    assert len(frames) == 3 - lost
    warnings = [record.getMessage() for record in caplog.records]
    assert len(warnings) == 2 and 'message 2' in warnings[0]
    assert '1 of 3 messages were bad' in warnings[1]


def test_only_the_first_bad_messages_are_logged(tmp_path, caplog):
    messages = [(CAMERA, image(START + n, size=3)) for n in range(50)]
    assert not list(bags.BagImages.from_bag(write_bag(tmp_path / 'bag', messages), skip_bad=True))
    assert len(caplog.records) == 6
    assert '50 of 50 messages were bad' in caplog.records[-1].getMessage()


def poses_bag(folder, kind):
    """Write poses at x = 1, 2, 3 m, one second apart, in messages of a given type."""
    stamped = [pose_stamped(START + n * S, n + 1.0) for n in range(3)]
    messages = {
        'PoseStamped': stamped,
        'Odometry': [odometry(START + n * S, n + 1.0) for n in range(3)],
        # Published twice; the second message corrects the first pose.
        'Path': [path_message(START, [pose_stamped(START, 9.0)]), path_message(START, stamped)],
    }[kind]
    return write_bag(folder, [('/truth', message) for message in messages])


@pytest.mark.parametrize('kind', ['PoseStamped', 'Odometry', 'Path'])
@pytest.mark.parametrize('topic', [None, '/truth'])
def test_poses(tmp_path, kind, topic):
    poses = bags.read_poses(poses_bag(tmp_path / 'bag', kind), topic)
    assert poses.stamps_ns.tolist() == [START, START + S, START + 2 * S]
    assert poses.positions.tolist() == [[1, 0, 0], [2, 0, 0], [3, 0, 0]]
    assert poses.quaternions.tolist() == [[0, 0, 0, 1]] * 3


def test_several_pose_topics(tmp_path):
    bag = write_bag(
        tmp_path / 'bag', [('/b', odometry(1, 0.0)), ('/a', path_message(1, [])), ('/c', image(1))]
    )
    remedy = r'use --ground-truth-topic /a \| --ground-truth-topic /b$'
    with pytest.raises(PlaceRecognitionError, match=remedy):
        bags.read_poses(bag, '/c')


def test_no_finite_pose(tmp_path):
    bag = write_bag(tmp_path / 'bag', [('/odom', odometry(1, np.nan))])
    with pytest.raises(PlaceRecognitionError, match='topic /odom has no pose of finite numbers'):
        bags.read_poses(bag, '/odom')


def test_bad_pose_message_error_has_the_number(tmp_path):
    with Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection('/odom', odometry(1, 0.0).__msgtype__, typestore=STORE)
        writer.write(connection, 1, b'\x00\x01\x00\x00')
    with pytest.raises(PlaceRecognitionError, match='/odom, message 1: 4 bytes are no nav_msgs'):
        bags.read_poses(tmp_path / 'bag', None)


def test_topics_are_counted(tmp_path):
    bag = write_bag(tmp_path / 'bag', [('/b', image(1)), ('/a', image(2)), ('/b', image(3))])
    assert topics(bag, bags.IMAGE_TYPES) == {'/a': 1, '/b': 2}
    assert list(topics(bag, bags.IMAGE_TYPES)) == ['/a', '/b']


def test_the_pose_before_an_image(tmp_path):
    messages = [('/odom', odometry(START + number * S, number)) for number in range(3)]
    poses = bags.read_poses(write_bag(tmp_path / 'bag', messages), '/odom')
    assert poses.before(START + S, S // 2).position == (1, 0, 0)
    assert poses.before(START + S + S // 2, S // 2).position == (1, 0, 0)
    assert poses.before(START + S - 1, S // 2) is None
    assert poses.before(START - 1, S // 2) is None


def test_the_first_calibration_is_the_camera(tmp_path):
    infos = [camera_info(START + number, 500.0 + number) for number in range(2)]
    bag = write_bag(tmp_path / 'bag', [('/camera/camera_info', info) for info in infos])
    found = bags.read_camera(bag, '/camera/camera_info', rectified=False)
    assert found.matrix[0, 0] == 500 / 640 and found.aspect == 0.75
    with pytest.raises(PlaceRecognitionError, match=r'message 1: .*not calibrated'):
        bags.read_camera(bag, '/camera/camera_info', rectified=True)
    with pytest.raises(PlaceRecognitionError, match='--camera-info-topic /camera/camera_info'):
        bags.read_camera(bag, '/other', rectified=False)


def test_missing_rosbags_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'rosbags.highlevel', None)
    with pytest.raises(PlaceRecognitionError, match=r'rosbags is not installed; `pip install ros'):
        bags.BagImages.from_bag(tmp_path / 'drive.bag')


def test_commands_import_neither_rosbags_nor_matplotlib():
    code = (
        'import sys, hdc_place_recognition.cli.evaluate, hdc_place_recognition.cli.experiments; '
        "print([name for name in ('rosbags', 'matplotlib', 'tqdm') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert done.stdout == '[]\n', done.stderr


def test_transforms_between_chosen_frames(tmp_path):
    types = STORE.types
    kind = 'tf2_msgs/msg/TFMessage'

    def transform(parent, child, x):
        return types['geometry_msgs/msg/TransformStamped'](
            header=types['std_msgs/msg/Header'](stamp=header(START).stamp, frame_id=parent),
            child_frame_id=child,
            transform=types['geometry_msgs/msg/Transform'](
                translation=types['geometry_msgs/msg/Vector3'](x, 0.0, 0.0),
                rotation=types['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0),
            ),
        )

    both = types[kind]([transform('map', 'odom', 1.0), transform('odom', 'base_link', 2.0)])
    bag = write_bag(tmp_path / 'bag', [('/tf', both)])
    assert bags.read_poses(bag, '/tf', frames='odom:base_link').positions.tolist() == [[2, 0, 0]]
    choices = r'use --odom-frames map:odom \| --odom-frames odom:base_link$'
    with pytest.raises(PlaceRecognitionError, match=choices):
        bags.read_poses(bag, '/tf', '--odom-topic')
    with pytest.raises(PlaceRecognitionError, match='--ground-truth-frames map: expected PARENT:'):
        bags.read_poses(bag, '/tf', frames='map')


def test_satellite_positions_have_no_orientation(tmp_path):
    types = STORE.types
    fixes = [
        types['sensor_msgs/msg/NavSatFix'](
            header=header(START + number * S),
            status=types['sensor_msgs/msg/NavSatStatus'](status=0, service=1),
            latitude=50.0 + number / 1000,
            longitude=14.0,
            altitude=200.0,
            position_covariance=np.zeros(9),
            position_covariance_type=0,
        )
        for number in range(2)
    ]
    poses = bags.read_poses(write_bag(tmp_path / 'bag', [('/f', fix) for fix in fixes]), '/f')
    assert poses.before(START, S).orientation == (0, 0, 0, 1)
    assert 110 < poses.positions[1, 1] < 112
    with pytest.raises(PlaceRecognitionError, match='use --max-angle 180'):
        poses.view_directions('x')
