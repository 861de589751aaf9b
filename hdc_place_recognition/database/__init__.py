# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The keyframe database: storing hypervectors and finding the most similar ones."""
