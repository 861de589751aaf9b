# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of parameters as ROS parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import Field, fields
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import coerce, Params, spec
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

_FIELDS = {item.name: item for item in fields(Params)}
# Parameters that rclpy declares itself, for any topic.
_QOS_OVERRIDES = 'qos_overrides.'


class RosParameters:
    """
    Declares the parameters on a node, and follows `ros2 param set`.

    :param changed: called with the new values after a live parameter was set.
    :raises PlaceRecognitionError: a value given at start is not allowed.
    """

    def __init__(self, node: Node, changed: Callable[[Params], None]) -> None:
        _convert_overrides(node)
        node.declare_parameters(
            '', [(item.name, item.default, descriptor(item)) for item in fields(Params)]
        )
        self.params = Params.from_dict({name: node.get_parameter(name).value for name in _FIELDS})
        self._changed = changed
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def to_set(self, parameters: Iterable[Parameter]) -> list[Parameter]:
        """
        Return the parameters that are left to set.

        A whole number for a float is converted. A parameter that is fixed at start and keeps its
        value is left out.

        :raises PlaceRecognitionError: a value is not allowed, or the parameter is fixed at start.
        """
        parameters = list(parameters)
        changed = self._with(parameters)
        found = []
        for item in parameters:
            if item.name not in _FIELDS:
                found.append(item)
                continue
            value = getattr(changed, item.name)
            if spec(_FIELDS[item.name]).live:
                found.append(Parameter(item.name, value=value))
            elif value != getattr(self.params, item.name):
                raise PlaceRecognitionError(
                    f'parameter {item.name} is read-only after the start; restart the node with '
                    f'-p {item.name}:={value}'
                )
        return found

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
            **{item.name: item.value for item in parameters if item.name in _FIELDS}
        )


def descriptor(item: Field[Any]) -> ParameterDescriptor:
    """Return the description of a parameter for ROS tools, with the range that they check."""
    about = spec(item)
    described = ParameterDescriptor(
        description=f'{about.doc} [{about.unit}]' if about.unit else about.doc,
        additional_constraints=', '.join(about.choices),
        read_only=not about.live,
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
    return sorted(
        name
        for name in node._parameter_overrides
        if not (node.has_parameter(name) or name.startswith(_QOS_OVERRIDES))
    )


def _convert_overrides(node: Node) -> None:
    """Convert whole numbers given at start for floats, which rclpy would refuse by their type."""
    for name, given in node._parameter_overrides.items():
        if name in _FIELDS:
            value = coerce(_FIELDS[name], given.value)
            if value is not given.value:
                node._parameter_overrides[name] = Parameter(name, value=value)
