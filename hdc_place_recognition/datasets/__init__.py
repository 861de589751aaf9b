# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Inputs of an evaluation: bags, folders of images, poses, ground truth."""
