# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Images, poses and cameras from rosbags.

All stamps are header stamps of the messages. The times of recording are used only for images of a
driver that sets no stamps.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
import logging
from pathlib import Path

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.conversions.camera_info import camera_from_message
from hdc_place_recognition.conversions.image import ImageConverter, stamp_ns
from hdc_place_recognition.conversions.poses import PoseConverter
from hdc_place_recognition.datasets.bag_reader import choose_topic, messages, StoredMessage
from hdc_place_recognition.datasets.poses import Poses
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.results import Frame

_log = logging.getLogger(__name__)

IMAGE_TYPES = ('sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage')
POSE_TYPES = (
    'nav_msgs/msg/Odometry',
    'geometry_msgs/msg/PoseStamped',
    'nav_msgs/msg/Path',
    'geometry_msgs/msg/PoseWithCovarianceStamped',
    'geometry_msgs/msg/TransformStamped',
    'tf2_msgs/msg/TFMessage',
    'sensor_msgs/msg/NavSatFix',
)
CAMERA_TYPES = ('sensor_msgs/msg/CameraInfo',)
_UNSTAMPED = (
    'the stamp is 0 again: the driver of the camera sets no stamps; '
    '--skip-bad uses the times of recording instead'
)
_WARNINGS = 5  # the first bad messages are logged one by one, all are counted


@dataclass(frozen=True)
class BagImages:
    """
    The images of one topic, in the order of the bag.

    :param bag: path of the bag.
    :param topic: topic of type sensor_msgs/Image or CompressedImage.
    :param n_messages: number of messages of the topic.
    :param skip_bad: log a warning for a bad message instead of raising an error. A message
        without a valid image is skipped. An image whose stamp does not increase is yielded; the
        recognizer skips it, as in the node. From the second stamp of 0 on, images without stamp
        get the time of recording.
    :param max_pixels: images of more pixels are refused.
    """

    bag: Path
    topic: str
    n_messages: int
    skip_bad: bool = False
    max_pixels: int = Params.max_image_pixels

    @classmethod
    def from_bag(
        cls,
        bag: Path,
        topic: str | None = None,
        skip_bad: bool = False,
        max_pixels: int = Params.max_image_pixels,
    ) -> BagImages:
        """
        Return the images of a topic; with `topic` None, of the only image topic.

        :raises PlaceRecognitionError: see :func:`choose_topic`.
        """
        return cls(bag, *choose_topic(bag, topic, IMAGE_TYPES, '--topic'), skip_bad, max_pixels)

    def __len__(self) -> int:
        return self.n_messages

    def __iter__(self) -> Iterator[Frame]:
        """
        Yield the images with their header stamps.

        :raises PlaceRecognitionError: a message is bad and `skip_bad` is False, or the bag is
            damaged.
        """
        last_ns, n_bad, unstamped = None, 0, False
        converter = ImageConverter(self.max_pixels)
        for message in messages(self.bag, self.topic):
            frame, problem = _frame(message, converter, last_ns)
            if frame and frame.stamp_ns == 0 and (unstamped or last_ns == 0):
                problem = '' if unstamped else f'{message.where}: {_UNSTAMPED}'
                frame, unstamped = replace(frame, stamp_ns=message.recorded_ns), True
            if problem:
                n_bad += 1
                self._report(problem, n_bad)
            if frame:
                last_ns = frame.stamp_ns
                yield frame
        if n_bad:
            _log.warning(
                'bag %s, topic %s: %d of %d messages were bad',
                self.bag,
                self.topic,
                n_bad,
                self.n_messages,
            )

    def _report(self, problem: str, n_bad: int) -> None:
        """Log a bad message; raise an error if bad messages are not to be skipped."""
        if not self.skip_bad:
            remedy = '' if problem.endswith(_UNSTAMPED) else '; --skip-bad skips such messages'
            raise PlaceRecognitionError(problem + remedy)
        if n_bad <= _WARNINGS:
            _log.warning('%s', problem)


def _frame(
    stored: StoredMessage, converter: ImageConverter, last_ns: int | None
) -> tuple[Frame | None, str]:
    """
    Decode a message.

    :param last_ns: stamp of the previous image, None for the first one.
    :return: the image, None if the message has no valid image; and the problem, '' if none.
    """
    try:
        message = stored.decode()
    except PlaceRecognitionError as error:
        return None, str(error)
    stamp = stamp_ns(message)
    try:
        image = converter.convert(message)
    except PlaceRecognitionError as error:
        return None, f'{stored.where}, stamp {stamp} ns: {error}'
    frame = Frame(stamp, image)
    if last_ns is None or stamp > last_ns:
        return frame, ''
    relation = 'repeats' if stamp == last_ns else 'goes back behind'
    return frame, f'{stored.where}: stamp {stamp} ns {relation} the previous one, {last_ns} ns'


def read_poses(
    bag: Path,
    topic: str,
    flag: str = '--ground-truth-topic',
    frames: str | None = None,
) -> Poses:
    """
    Return the poses of a topic of one of `POSE_TYPES`.

    A growing path is often published repeatedly; for each stamp the last published pose is used.

    :param bag: path of the bag.
    :param topic: name of the topic.
    :param flag: command-line flag that selects the topic, for error messages.
    :param frames: 'PARENT:CHILD', the frames of the transforms; None for the only pair.
    :raises PlaceRecognitionError: no such topic or frames, no finite pose, or the bag is damaged.
    """
    frames_flag = flag.replace('-topic', '-frames')
    chosen, _ = choose_topic(bag, topic, POSE_TYPES, flag)
    converter = PoseConverter(_frame_pair(frames, frames_flag))
    poses = [
        pose for stored in messages(bag, chosen) for pose in converter.convert(stored.decode())
    ]
    converter.check_frames(f'bag {bag}, topic {chosen}', frames_flag)
    return Poses.from_rows(
        [pose.stamp_ns for pose in poses],
        [pose.row for pose in poses],
        f'bag {bag}, topic {chosen}',
    )


def _frame_pair(frames: str | None, flag: str) -> tuple[str, str] | None:
    if frames is None:
        return None
    parent, colon, child = frames.partition(':')
    if not (parent and colon and child):
        raise PlaceRecognitionError(f'{flag} {frames}: expected PARENT:CHILD, as map:base_link')
    return parent.lstrip('/'), child.lstrip('/')


def read_camera(path: Path, topic: str, *, rectified: bool) -> Camera:
    """
    Return the camera of the first message of a CameraInfo topic.

    :param path: path of the bag.
    :param topic: name of the topic.
    :param rectified: True if the images are rectified.
    :raises PlaceRecognitionError: no such topic, the camera is not calibrated, its distortion
        model is not supported, or the bag is damaged.
    """
    chosen, _ = choose_topic(path, topic, CAMERA_TYPES, '--camera-info-topic')
    with closing(messages(path, chosen)) as infos:
        stored = next(infos)
        message = stored.decode()
    try:
        return camera_from_message(message, rectified=rectified)
    except PlaceRecognitionError as error:
        raise PlaceRecognitionError(f'{stored.where}: {error}') from error
