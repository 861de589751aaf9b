# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What everything costs, as ratios to what the machine can do."""
