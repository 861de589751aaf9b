# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of parameters as ROS parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import Field, fields
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params, spec
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

_NAMES = tuple(item.name for item in fields(Params))


class RosParameters:
    """
    Declares the parameters on a node, and follows `ros2 param set`.

    :param changed: called with the new values after a live parameter was set.
    :raises PlaceRecognitionError: a value given at start is not allowed.
    """

    def __init__(self, node: Node, changed: Callable[[Params], None]) -> None:
        node.declare_parameters(
            '', [(item.name, item.default, descriptor(item)) for item in fields(Params)]
        )
        self.params = Params.from_dict({name: node.get_parameter(name).value for name in _NAMES})
        self._changed = changed
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def _check(self, parameters: Iterable[Parameter]) -> SetParametersResult:
        try:
            self._with(parameters)
        except PlaceRecognitionError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: Iterable[Parameter]) -> None:
        changed = self._with(parameters)
        if changed != self.params:
            self.params = changed
            self._changed(changed)

    def _with(self, parameters: Iterable[Parameter]) -> Params:
        return self.params.replace(
            **{item.name: item.value for item in parameters if item.name in _NAMES}
        )


def descriptor(item: Field[Any]) -> ParameterDescriptor:
    """Return the description of a parameter for ROS tools, with the range that they check."""
    about = spec(item)
    described = ParameterDescriptor(
        description=f'{about.doc} [{about.unit}]' if about.unit else about.doc,
        additional_constraints=', '.join(about.choices),
        read_only=not about.live,
        # ROS would refuse 1 for 1.0 by its type; our own check accepts it.
        dynamic_typing=type(item.default) is float,
    )
    if about.low is not None and about.high is not None:
        if type(item.default) is float:
            described.floating_point_range = [
                FloatingPointRange(from_value=about.low, to_value=about.high)
            ]
        else:
            described.integer_range = [
                IntegerRange(from_value=int(about.low), to_value=int(about.high))
            ]
    return described


def unknown_overrides(node: Node) -> list[str]:
    """Return parameters given at start that the node does not have, which ROS ignores."""
    return sorted(name for name in node._parameter_overrides if not node.has_parameter(name))
