# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Messages and bags for tests."""

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

S = 10**9
START = 1_776_863_762_100_071_637  # 19 digits: not exact as a float
STORE = get_typestore(Stores.ROS2_JAZZY)
STORE1 = get_typestore(Stores.ROS1_NOETIC)
CAMERA = '/camera/image_raw'


def header(stamp_ns, store=STORE):
    """Return a header with this stamp."""
    sec, nanosec = divmod(stamp_ns, S)
    stamp = store.types['builtin_interfaces/msg/Time'](sec=sec, nanosec=nanosec)
    extra = {'seq': 0} if store is STORE1 else {}
    return store.types['std_msgs/msg/Header'](stamp=stamp, frame_id='camera', **extra)


def image(stamp_ns, value=0, size=None, store=STORE):
    """Return a message of a 4 x 6 gray image of one value, with `size` bytes of data."""
    return store.types['sensor_msgs/msg/Image'](
        header=header(stamp_ns, store),
        height=4,
        width=6,
        encoding='mono8',
        is_bigendian=0,
        step=6,
        data=np.full(24 if size is None else size, value, np.uint8),
    )


def camera_info(stamp_ns, focal=500.0):
    types = STORE.types
    k = np.array([focal, 0, 320, 0, focal, 240, 0, 0, 1.0])
    return types['sensor_msgs/msg/CameraInfo'](
        header=header(stamp_ns),
        height=480,
        width=640,
        distortion_model='plumb_bob',
        d=np.zeros(5),
        k=k,
        r=np.eye(3).ravel(),
        p=np.zeros(12),
        binning_x=0,
        binning_y=0,
        roi=types['sensor_msgs/msg/RegionOfInterest'](0, 0, 0, 0, False),
    )


def pose(x, y=0.0):
    """Return a pose with the identity orientation."""
    types = STORE.types
    return types['geometry_msgs/msg/Pose'](
        position=types['geometry_msgs/msg/Point'](x=x, y=y, z=0.0),
        orientation=types['geometry_msgs/msg/Quaternion'](x=0.0, y=0.0, z=0.0, w=1.0),
    )


def pose_stamped(stamp_ns, x):
    return STORE.types['geometry_msgs/msg/PoseStamped'](header=header(stamp_ns), pose=pose(x))


def path_message(stamp_ns, poses):
    return STORE.types['nav_msgs/msg/Path'](header=header(stamp_ns), poses=poses)


def odometry(stamp_ns, x):
    types = STORE.types
    still = types['geometry_msgs/msg/Vector3'](x=0.0, y=0.0, z=0.0)
    return types['nav_msgs/msg/Odometry'](
        header=header(stamp_ns),
        child_frame_id='base_link',
        pose=types['geometry_msgs/msg/PoseWithCovariance'](pose=pose(x), covariance=np.zeros(36)),
        twist=types['geometry_msgs/msg/TwistWithCovariance'](
            twist=types['geometry_msgs/msg/Twist'](linear=still, angular=still),
            covariance=np.zeros(36),
        ),
    )


def write_bag(folder, messages, plugin=StoragePlugin.SQLITE3, empty=()):
    """Write (topic, message) or (topic, serialized image) pairs in order; return the path."""
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        connections = {
            topic: writer.add_connection(topic, kind, typestore=STORE) for topic, kind in empty
        }
        for number, (topic, message) in enumerate(messages):
            raw = isinstance(message, bytes)
            kind = 'sensor_msgs/msg/Image' if raw else message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            data = message if raw else STORE.serialize_cdr(message, kind)
            # The receive time is far from the header stamps and must not be used.
            writer.write(connections[topic], 5 * S + number, data)
    return folder


def images_bag(folder, stamps_ns, plugin=StoragePlugin.SQLITE3):
    return write_bag(
        folder,
        [(CAMERA, image(stamp, value % 256)) for value, stamp in enumerate(stamps_ns)],
        plugin,
    )
