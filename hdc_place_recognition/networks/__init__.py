# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Neural networks: weights, ONNX graph, file cache and inference."""
