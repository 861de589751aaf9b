# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The subscription to the image topic: its name, type and QoS, and why no image arrives."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any

from hdc_place_recognition.params.table import Params
from hdc_place_recognition.ros.node_statistics import Statistics
from hdc_place_recognition.ros.subscription import MatchedSubscription
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    qos_check_compatible,
    qos_profile_sensor_data,
    QoSCompatibility,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
)
from sensor_msgs.msg import CompressedImage, Image

_TYPES = {'raw': Image, 'compressed': CompressedImage}
_COMPRESSED = '/compressed'
_RELIABLE = QoSProfile(
    depth=5, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE
)
_PROFILES = {'auto': _RELIABLE, 'sensor_data': qos_profile_sensor_data, 'reliable': _RELIABLE}
SILENCE_S = 5.0
LOSS_REMEDY = (
    'make the publisher reliable, or start both sides with config/large_images.xml '
    '(doc/troubleshooting.md)'
)


class ImageInput:
    """
    Subscribes to the relative topic `image`, and explains when no image arrives.

    :param received: called with each message, in the thread of the executor.
    :raises PlaceRecognitionError: a QoS override is not valid.
    """

    def __init__(
        self, node: Node, params: Params, statistics: Statistics, received: Callable[[Any], None]
    ) -> None:
        self._statistics, self._received = statistics, received
        self._last = monotonic()
        self._subscription = MatchedSubscription(
            node,
            _TYPES[params.image_transport],
            image_topic(node, params.image_transport),
            self._on_message,
            _PROFILES[params.image_qos],
            follows=(QoSPolicyKind.RELIABILITY,) if params.image_qos == 'auto' else (),
            lost=self._on_lost,
        )

    @property
    def topic(self) -> str:
        """Return the full name of the topic, after remapping."""
        return self._subscription.topic

    @property
    def reliability(self) -> str:
        """Return the reliability of the subscription in words."""
        return str(self._subscription.profile.reliability.name).lower().replace('_', ' ')

    def problem(self) -> str:
        """Return why no image has arrived for SILENCE_S, '' if one has."""
        silent_s = monotonic() - self._last
        if silent_s < SILENCE_S:
            return ''
        publishers = self._subscription.publishers()
        causes = [cause for publisher in publishers if (cause := self._cause(publisher))]
        if self._statistics.lost_by_dds:
            causes.append(f'DDS has lost {self._statistics.lost_by_dds} images: {LOSS_REMEDY}')
        return (
            f'no image on {self.topic} for {silent_s:.0f} s, publishers: {len(publishers)}'
            f'{"".join("; " + cause for cause in causes)}'
        )

    def _cause(self, publisher: Any) -> str:
        """Return why images of a publisher do not arrive, '' if they should."""
        name = f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
        wanted = self._subscription.wanted_type
        if publisher.topic_type != wanted:
            return (
                f'{name} publishes {publisher.topic_type}, not {wanted}: '
                f'see the parameter image_transport'
            )
        compatible, reason = qos_check_compatible(
            publisher.qos_profile, self._subscription.profile
        )
        if compatible == QoSCompatibility.ERROR:
            return f'{name} has incompatible QoS: {reason}'.rstrip('; ')
        return ''

    def _on_message(self, message: Any) -> None:
        self._last = monotonic()
        self._statistics.received += 1
        self._received(message)

    def _on_lost(self, count: int) -> None:
        self._statistics.lost_by_dds += count


def image_topic(node: Node, transport: str) -> str:
    """Return the full name of the image topic; that of compressed images ends in /compressed."""
    topic = str(node.resolve_topic_name('image'))
    if transport == 'compressed' and not topic.endswith(_COMPRESSED):
        return topic + _COMPRESSED
    return topic


def camera_info_topic(node: Node) -> str:
    """Return the full name of the camera_info topic: if not remapped, beside the image topic."""
    topic = str(node.resolve_topic_name('camera_info'))
    if topic != node.resolve_topic_name('camera_info', only_expand=True):
        return topic
    camera, _, _ = image_topic(node, 'raw').removesuffix(_COMPRESSED).rpartition('/')
    return f'{camera}/camera_info'
