# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Message-like objects of ROS as arrays and cameras; no rclpy."""
