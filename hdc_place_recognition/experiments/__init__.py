# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The measurements that chose the defaults and the numbers of the decision."""
