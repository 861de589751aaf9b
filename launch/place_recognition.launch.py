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
        DeclareLaunchArgument('namespace', default_value='', description='Namespace of the node.'),
        DeclareLaunchArgument(
            'use_sim_time',
            default_value='false',
            description='Follow /clock. Images are selected by their stamps in any case.',
        ),
        DeclareLaunchArgument(
            'params_file',
            default_value=CONFIG,
            description='Parameter file, as config/place_recognition.yaml.',
        ),
        DeclareLaunchArgument('image', default_value='image', description='Image topic.'),
        DeclareLaunchArgument(
            'camera_info', default_value='camera_info', description='Calibration topic.'
        ),
        DeclareLaunchArgument('odom', default_value='odom', description='Odometry topic.'),
        DeclareLaunchArgument(
            'log_level', default_value='info', description='Log level of the node.'
        ),
    ]
    values = {argument.name: LaunchConfiguration(argument.name) for argument in arguments}
    node = Node(
        package=PACKAGE,
        executable='place_recognition_node',
        namespace=values['namespace'],
        output='screen',
        arguments=['--ros-args', '--log-level', values['log_level']],
        parameters=[values['params_file'], {'use_sim_time': values['use_sim_time']}],
        remappings=[(topic, values[topic]) for topic in ('image', 'camera_info', 'odom')],
    )
    return LaunchDescription([*arguments, node])
