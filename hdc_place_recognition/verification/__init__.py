# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Deciding which candidates are loop closures: geometry, temporal consistency, score."""
