# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The method of Neubert and Schubert (CVPR 2021): no ROS, no files, no printing."""
