# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A drive round a block of streets: rendered, played through the node, and compared."""
