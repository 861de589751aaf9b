# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Hyperdimensional computing after Neubert and Schubert (CVPR 2021), Section 3: numpy alone."""
