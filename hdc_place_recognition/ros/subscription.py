# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Subscriptions whose quality of service follows the publishers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions

# Publishers may appear, end and change at any time.
_PERIOD_S = 0.25
# Policies that a user can always override; those that follow the publishers are overridden only if
# the user says so.
_OVERRIDABLE = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH)
_ON_REQUEST = (QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY)


class MatchedSubscription:
    """
    A subscription that is made again when the publishers on its topic offer another QoS.

    The best policies that all publishers offer are used: reliable if all are reliable, and
    transient local (messages sent before the start arrive too) if all are. Parameters
    `qos_overrides.<topic>.subscription.*` take precedence.

    :param kind: class of the messages.
    :param topic: full name of the topic.
    :param received: called with each message, in the thread of the executor.
    :param profile: QoS as long as there are no publishers, with all policies that do not follow.
    :param follows: policies that follow the publishers.
    :param lost: called with the number of messages that DDS has just lost.
    :raises PlaceRecognitionError: a QoS override is not valid.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        received: Callable[[Any], None],
        profile: QoSProfile,
        *,
        follows: Sequence[QoSPolicyKind] = (),
        lost: Callable[[int], None] | None = None,
    ) -> None:
        self._node, self._kind, self._received = node, kind, received
        self._lost = lost or (lambda count: None)
        self.topic, self._profile = topic, profile
        self._requested = tuple(kind for kind in _ON_REQUEST if self._is_overridden(kind))
        self._follows = tuple(kind for kind in follows if kind not in self._requested)
        self._profile = self._matched()
        self._subscription = self._create()
        if self._follows:
            clock = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = node.create_timer(_PERIOD_S, self.match, clock=clock)

    @property
    def profile(self) -> QoSProfile:
        """Return the QoS of the subscription as it is now."""
        return self._subscription.qos_profile

    @property
    def wanted_type(self) -> str:
        """Return the type of the messages, such as sensor_msgs/msg/Image."""
        package, folder, *_ = self._kind.__module__.split('.')
        return f'{package}/{folder}/{self._kind.__name__}'

    def publishers(self) -> list[Any]:
        """Return the publishers on the topic, of any type."""
        return list(self._node.get_publishers_info_by_topic(self.topic))

    def match(self) -> None:
        """Make the subscription again if the publishers offer another QoS."""
        matched = self._matched()
        if matched != self._profile:
            self._profile = matched
            self._node.destroy_subscription(self._subscription)
            self._subscription = self._create()

    def _matched(self) -> QoSProfile:
        """Return the best QoS that all publishers offer; the present one without publishers."""
        offers = [
            info.qos_profile for info in self.publishers() if info.topic_type == self.wanted_type
        ]
        matched = copy(self._profile)
        if offers and QoSPolicyKind.RELIABILITY in self._follows:
            reliable = all(offer.reliability == ReliabilityPolicy.RELIABLE for offer in offers)
            matched.reliability = (
                ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
            )
        if offers and QoSPolicyKind.DURABILITY in self._follows:
            latched = all(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers)
            matched.durability = (
                DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
            )
        return matched

    def _create(self) -> Any:
        try:
            return self._node.create_subscription(
                self._kind,
                self.topic,
                self._received,
                copy(self._profile),
                qos_overriding_options=QoSOverridingOptions((*_OVERRIDABLE, *self._requested)),
                event_callbacks=SubscriptionEventCallbacks(
                    message_lost=lambda event: self._lost(event.total_count_change),
                    # Without a callback rclpy logs a warning; problems are in diagnostics.
                    incompatible_qos=lambda event: None,
                ),
            )
        except (InvalidQosOverridesError, AttributeError, TypeError, ValueError) as error:
            raise PlaceRecognitionError(self._refused(error)) from error
        except RuntimeError as error:
            if 'QoS override' not in str(error):
                raise
            raise PlaceRecognitionError(self._refused(error)) from error

    def _refused(self, error: Exception) -> str:
        return f'parameter qos_overrides.{self.topic}.subscription: {error}'

    def _is_overridden(self, kind: QoSPolicyKind) -> bool:
        name = f'qos_overrides.{self.topic}.subscription.{kind.name.lower()}'
        return name in self._node._parameter_overrides
