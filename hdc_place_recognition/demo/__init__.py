# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The demo: render a drive around a block of streets, play it through the node, check closures."""
