# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of parameters, and its forms: YAML, flags, Markdown."""
