# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Running the recognizer on a data set, and measuring its answers."""
