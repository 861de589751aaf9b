# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs the recognizer on a dataset; computes metrics, writes tables, files and plots."""
