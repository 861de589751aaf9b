# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The subscription to the image topic: type, QoS, and why no image arrives."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any

from hdc_place_recognition.params.table import Params
from hdc_place_recognition.ros.node_statistics import Statistics
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    qos_check_compatible,
    qos_profile_sensor_data,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import CompressedImage, Image

_TYPES = {'raw': Image, 'compressed': CompressedImage}
_PROFILES = {
    'sensor_data': qos_profile_sensor_data,
    'reliable': QoSProfile(
        depth=5, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE
    ),
}
SILENCE_S = 5.0


class ImageInput:
    """
    Subscribes to the relative topic `image`, and explains when no image arrives.

    :param received: called with each message, in the thread of the executor.
    """

    def __init__(
        self, node: Node, params: Params, statistics: Statistics, received: Callable[[Any], None]
    ) -> None:
        self._node, self._statistics, self._received = node, statistics, received
        self._last = monotonic()
        self._type = _TYPES[params.image_transport]
        self._subscription = node.create_subscription(
            self._type,
            'image',
            self._on_message,
            _PROFILES[params.image_qos],
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            event_callbacks=SubscriptionEventCallbacks(
                message_lost=self._on_lost, incompatible_qos=lambda event: None
            ),
        )

    @property
    def topic(self) -> str:
        """Return the full name of the topic, after remapping."""
        return str(self._subscription.topic_name)

    def problem(self) -> str:
        """Return why no image has arrived for SILENCE_S, '' if one has."""
        silent_s = monotonic() - self._last
        if silent_s < SILENCE_S:
            return ''
        publishers = self._node.get_publishers_info_by_topic(self.topic)
        causes = [cause for publisher in publishers if (cause := self._cause(publisher))]
        return (
            f'no image on {self.topic} for {silent_s:.0f} s, publishers: {len(publishers)}'
            f'{"".join("; " + cause for cause in causes)}'
        )

    def _cause(self, publisher: Any) -> str:
        """Return why images of a publisher do not arrive, '' if they should."""
        name = f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
        wanted = f'sensor_msgs/msg/{self._type.__name__}'
        if publisher.topic_type != wanted:
            return (
                f'{name} publishes {publisher.topic_type}, not {wanted}: '
                f'see the parameter image_transport'
            )
        compatible, reason = qos_check_compatible(
            publisher.qos_profile, self._subscription.qos_profile
        )
        if compatible == QoSCompatibility.ERROR:
            return f'{name} has incompatible QoS: {reason}'.rstrip('; ')
        return ''

    def _on_message(self, message: Any) -> None:
        self._last = monotonic()
        self._statistics.received += 1
        self._received(message)

    def _on_lost(self, event: Any) -> None:
        self._statistics.lost_by_dds = event.total_count
