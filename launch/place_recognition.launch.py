# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Starts the node; every parameter of the node is an argument, such as min_score:=0.8."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from hdc_place_recognition.params.formats import NODE_NAME
from hdc_place_recognition.params.table import Params, spec
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PACKAGE = 'hdc_place_recognition'
TOPICS = ('image', 'camera_info', 'odom')
# Name: default, description. An empty argument is not passed on, so that it overrides neither the
# parameter file nor a SetParameter or SetRemap of the launch file that includes this one.
ARGUMENTS = {
    'name': (NODE_NAME, 'Name of the node.'),
    'namespace': ('', 'Namespace of the node.'),
    'use_sim_time': ('', 'Follow /clock. Images are selected by their stamps in any case.'),
    'params_file': ('', 'Parameter file; config/place_recognition.yaml is an example.'),
    'image': ('', 'Image topic, without /compressed.'),
    'camera_info': ('', 'Calibration topic; by default camera_info beside the image topic.'),
    'odom': ('', 'Odometry topic.'),
    'log_level': ('info', 'Log level of the node.'),
    'respawn': ('false', 'Start the node again when it has ended.'),
}
BOOLEANS = {'true': True, '1': True, 'false': False, '0': False}


def generate_launch_description() -> LaunchDescription:
    """Return the node with its arguments."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    arguments += [
        DeclareLaunchArgument(
            item.name,
            default_value='',
            description=f'Parameter of the node, {item.default!r} if not set. {spec(item).doc}',
        )
        for item in fields(Params)
    ]
    names = [argument.name for argument in arguments]
    return LaunchDescription([*arguments, OpaqueFunction(function=start, args=[names])])


def start(context: LaunchContext, names: list[str]) -> list[Node]:
    """Return the node for the values of the arguments."""
    return [Node(**options({name: LaunchConfiguration(name).perform(context) for name in names}))]


def options(values: Mapping[str, str]) -> dict[str, Any]:
    """
    Return the arguments of launch_ros's Node.

    :param values: of all launch arguments, '' if not given.
    :raises ValueError: a value is not of the type of its parameter.
    """
    parameters: list[Any] = [values['params_file']] if values['params_file'] else []
    kinds: dict[str, type] = {item.name: type(item.default) for item in fields(Params)}
    given = {
        name: typed(name, values[name], kind)
        for name, kind in {'use_sim_time': bool, **kinds}.items()
        if values[name]
    }
    return {
        'package': PACKAGE,
        'executable': NODE_NAME,
        'name': values['name'],
        'namespace': values['namespace'],
        'output': 'screen',
        'arguments': ['--ros-args', '--log-level', values['log_level']],
        'parameters': [*parameters, given] if given else parameters,
        'remappings': [(topic, values[topic]) for topic in TOPICS if values[topic]],
        'respawn': typed('respawn', values['respawn'], bool),
        'respawn_delay': 2.0,
    }


def typed(name: str, text: str, kind: type) -> Any:
    """
    Return the value of an argument as its type.

    :raises ValueError: it is not of this type.
    """
    if kind is str:
        # Otherwise launch would make a number of a folder named 5.
        return ParameterValue(text, value_type=str)
    try:
        return BOOLEANS[text.lower()] if kind is bool else kind(text)
    except (KeyError, ValueError) as error:
        raise ValueError(f'launch argument {name}: {text!r} is no {kind.__name__}') from error
