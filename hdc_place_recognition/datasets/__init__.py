# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Inputs of an evaluation: rosbags, image folders, poses and ground truth."""
