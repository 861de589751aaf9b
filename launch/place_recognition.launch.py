# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Start the node with a parameter file and its image topic."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'hdc_place_recognition'
CONFIG = PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'place_recognition.yaml'])


def generate_launch_description() -> LaunchDescription:
    """Return the node with its arguments."""
    arguments = [
        DeclareLaunchArgument('namespace', default_value='', description='Of the node.'),
        DeclareLaunchArgument(
            'use_sim_time',
            default_value='false',
            description='Follow /clock; images go by their stamps anyway.',
        ),
        DeclareLaunchArgument(
            'params_file',
            default_value=CONFIG,
            description='Parameters, as config/place_recognition.yaml.',
        ),
        DeclareLaunchArgument('image', default_value='image', description='Image topic.'),
        DeclareLaunchArgument(
            'camera_info', default_value='camera_info', description='Calibration topic.'
        ),
        DeclareLaunchArgument('odom', default_value='odom', description='Odometry topic.'),
        DeclareLaunchArgument('log_level', default_value='info', description='Of the node.'),
    ]
    given = {argument.name: LaunchConfiguration(argument.name) for argument in arguments}
    node = Node(
        package=PACKAGE,
        executable='place_recognition_node',
        namespace=given['namespace'],
        output='screen',
        arguments=['--ros-args', '--log-level', given['log_level']],
        parameters=[given['params_file'], {'use_sim_time': given['use_sim_time']}],
        remappings=[(topic, given[topic]) for topic in ('image', 'camera_info', 'odom')],
    )
    return LaunchDescription([*arguments, node])
