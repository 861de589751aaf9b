# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Images and poses from rosbags.

Times are those of the messages' headers, never those at which the bag was written.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
import logging
from pathlib import Path

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.conversions.camera_info import camera_from_message
from hdc_place_recognition.conversions.image import image_from_message, stamp_ns
from hdc_place_recognition.datasets.bag_reader import choose_topic, messages, StoredMessage
from hdc_place_recognition.datasets.dataset import Frame
from hdc_place_recognition.datasets.poses import Poses
from hdc_place_recognition.errors import PlaceRecognitionError

_log = logging.getLogger(__name__)

IMAGE_TYPES = ('sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage')
POSE_TYPES = ('nav_msgs/msg/Odometry', 'geometry_msgs/msg/PoseStamped', 'nav_msgs/msg/Path')
CAMERA_TYPES = ('sensor_msgs/msg/CameraInfo',)
_WARNINGS = 5  # bad messages that are named one by one; all are counted


@dataclass(frozen=True)
class BagImages:
    """
    The images of one topic, in the order of the bag.

    :param bag: path of the bag.
    :param topic: of sensor_msgs/Image or CompressedImage.
    :param n_messages: how many messages the topic has.
    :param skip_bad: pass over messages that hold no image, and hand on images whose stamp does
        not rise (the recognizer passes over those, as in the node), with a warning; otherwise
        either is an error.
    """

    bag: Path
    topic: str
    n_messages: int
    skip_bad: bool = False

    @classmethod
    def from_bag(cls, bag: Path, topic: str | None = None, skip_bad: bool = False) -> BagImages:
        """
        Return the images of the bag's image topic.

        :raises PlaceRecognitionError: as :func:`choose_topic`.
        """
        return cls(bag, *choose_topic(bag, topic, IMAGE_TYPES, '--topic'), skip_bad)

    def __len__(self) -> int:
        return self.n_messages

    def __iter__(self) -> Iterator[Frame]:
        """
        Yield header stamp and image.

        :raises PlaceRecognitionError: a message is bad and `skip_bad` is not set, or the bag is
            damaged.
        """
        last_ns, n_bad = None, 0
        for message in messages(self.bag, self.topic):
            frame, complaint = _frame(message, last_ns)
            if complaint:
                n_bad += 1
                self._complain(complaint, n_bad)
            if frame:
                last_ns = frame[0]
                yield frame
        if n_bad:
            _log.warning(
                'bag %s, topic %s: %d of %d messages were bad',
                self.bag,
                self.topic,
                n_bad,
                self.n_messages,
            )

    def _complain(self, complaint: str, n_bad: int) -> None:
        if not self.skip_bad:
            raise PlaceRecognitionError(f'{complaint}; --skip-bad goes on without such messages')
        if n_bad <= _WARNINGS:
            _log.warning('%s', complaint)


def _frame(stored: StoredMessage, last_ns: int | None) -> tuple[Frame | None, str]:
    """Return the frame of a message, None if it holds no image, and what is wrong, or ''."""
    try:
        message = stored.decode()
    except PlaceRecognitionError as error:
        return None, str(error)
    stamp = stamp_ns(message)
    try:
        image = image_from_message(message)
    except PlaceRecognitionError as error:
        return None, f'{stored.where}, stamp {stamp} ns: {error}'
    if last_ns is None or stamp > last_ns:
        return (stamp, image), ''
    wrong = 'repeats' if stamp == last_ns else 'goes back behind'
    return (stamp, image), f'{stored.where}: stamp {stamp} ns {wrong} the one before, {last_ns} ns'


def read_poses(bag: Path, topic: str, flag: str = '--ground-truth-topic') -> Poses:
    """
    Return the poses of an Odometry, PoseStamped or Path topic.

    A path may be published again and again as it grows: the newest pose of each stamp counts.

    :param bag: path of the bag.
    :param topic: the topic.
    :param flag: by which users choose it, for messages.
    :raises PlaceRecognitionError: no such topic, no finite pose, or the bag is damaged.
    """
    chosen, _ = choose_topic(bag, topic, POSE_TYPES, flag)
    stamps, rows = [], []
    for stored in messages(bag, chosen):
        message = stored.decode()
        for stamped in getattr(message, 'poses', [message]):
            pose = getattr(stamped.pose, 'pose', stamped.pose)
            at, turned = pose.position, pose.orientation
            stamps.append(stamp_ns(stamped))
            rows.append([at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w])
    return Poses.from_rows(stamps, rows, f'bag {bag}, topic {chosen}')


def read_camera(path: Path, topic: str, *, rectified: bool) -> Camera:
    """
    Return the camera of the first message of a CameraInfo topic.

    :param path: of the bag.
    :param rectified: whether the images are rectified.
    :raises PlaceRecognitionError: no such topic, a camera that is not calibrated or not known, or
        the bag is damaged.
    """
    chosen, _ = choose_topic(path, topic, CAMERA_TYPES, '--camera-info-topic')
    with closing(messages(path, chosen)) as found:
        stored = next(found)
        message = stored.decode()
    try:
        return camera_from_message(message, rectified=rectified)
    except PlaceRecognitionError as error:
        raise PlaceRecognitionError(f'{stored.where}: {error}') from error
