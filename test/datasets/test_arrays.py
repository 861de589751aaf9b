# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Two aligned traverses in frames.npz."""

from hdc_place_recognition.datasets.dataset import Mode
from hdc_place_recognition.datasets.open_dataset import open_dataset
from hdc_place_recognition.errors import PlaceRecognitionError
import numpy as np
import pytest

S = 10**9


def test_two_aligned_traverses(tmp_path):
    summer, winter = (np.full((10, 4, 6), value, np.uint8) for value in (10, 20))
    np.savez(tmp_path / 'frames.npz', summer=summer, winter=winter)
    dataset = open_dataset(tmp_path)
    assert dataset.mode is Mode.TRAVERSES and dataset.name == tmp_path.name
    assert [frame.stamp_ns for frame in dataset.queries] == [index * S for index in range(10)]
    assert len(dataset.reference) == 10
    assert {int(frame.image[0, 0]) for frame in dataset.reference} == {10}
    assert {int(frame.image[0, 0]) for frame in dataset.queries} == {20}
    # A video: keyframes are selected as on a robot.
    assert dataset.overrides == {'min_interval_s': 0.0, 'exact': True}
    found = dataset.ground_truth.truth(np.array([0, 9]) * S, np.arange(10) * S)
    assert found.hard.sum(axis=1).tolist() == [3, 3] and found.soft.sum(axis=1).tolist() == [6, 6]
    assert found.hard[0, 2] and not found.hard[0, 3] and found.soft[0, 5]
    assert '+-2' in dataset.ground_truth.summary


@pytest.mark.parametrize(
    'arrays',
    [
        {'summer': np.zeros((3, 4, 6), np.uint8)},
        {'summer': np.zeros((3, 4, 6), np.uint8), 'winter': np.zeros((2, 4, 6), np.uint8)},
        {'summer': np.zeros((3, 4, 6)), 'winter': np.zeros((3, 4, 6))},
    ],
)
def test_arrays_that_do_not_fit_are_refused(tmp_path, arrays):
    np.savez(tmp_path / 'frames.npz', **arrays)
    with pytest.raises(PlaceRecognitionError, match=r'frames\.npz'):
        open_dataset(tmp_path)


def test_a_damaged_file_is_refused(tmp_path):
    (tmp_path / 'frames.npz').write_bytes(b'no npz')
    with pytest.raises(PlaceRecognitionError, match=r'frames\.npz'):
        open_dataset(tmp_path)
