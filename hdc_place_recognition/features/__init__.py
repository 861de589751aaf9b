# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Local features: extractors, their registry, and compact keypoints for verification."""
