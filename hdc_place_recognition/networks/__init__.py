# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Networks on disk: weights, ONNX graphs, their cache, and what runs them."""
