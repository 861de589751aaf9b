# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Converts ROS messages (of rclpy, rosbags or tests) to arrays and cameras; needs no rclpy."""
