# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The means that are subtracted: by hand."""

from hdc_place_recognition.database.centering import RunningMeans
import numpy as np


def test_means_of_the_images_so_far():
    means = RunningMeans(3, 2)
    assert means.of_queries().tolist() == [[0, 0]] * 3
    assert means.of_keyframes().tolist() == [0, 0]
    first = np.array([[1, 2], [3, 4], [5, 6]], np.float32)
    means.update(first)
    assert means.of_queries().tolist() == first.tolist()
    assert means.of_keyframes().tolist() == [3, 4]
    means.update(np.zeros((3, 2), np.float32))
    assert means.of_queries().tolist() == (first / 2).tolist()
    # Keyframes are stored under the zero shift, the middle one.
    assert means.of_keyframes().tolist() == [1.5, 2]
    assert means.of_keyframes().dtype == np.float32
