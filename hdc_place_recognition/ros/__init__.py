# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 node: the only package that imports rclpy, besides the demo."""
