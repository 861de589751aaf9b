# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Images that support those after them."""

from hdc_place_recognition.verification.temporal import Consistency
import pytest

STRONG, WEAK = 3.0, 1.0


def after(*places: int, strength: float = STRONG) -> Consistency:
    consistency = Consistency()
    for place in places:
        consistency.remember(place, strength)
    return consistency


@pytest.mark.parametrize('places', [(10, 11, 12), (16, 15, 14)])
def test_neighbouring_places_support_in_either_direction(places):
    assert after(*places).support(13, moved=True) == 1.0


def test_isolated_is_not_supported():
    assert after(50, 90, 20).support(13, moved=True) == 0.0
    assert after().support(13, moved=True) == 0.0


def test_one_supporter_is_half_of_enough():
    assert after(90, 90, 12).support(13, moved=True) == 0.5


def test_weak_images_support_nothing():
    assert after(10, 11, 12, strength=WEAK).support(13, moved=True) == 0.0


def test_older_images_may_be_further_away_up_to_three():
    assert after(9).support(13, moved=True) == 0.5
    assert after(8).support(13, moved=True) == 0.0
    assert after(8, 90).support(13, moved=True) > 0.0
    assert after(13, 90, 90, 90).support(13, moved=True) == 0.0


def test_an_image_does_not_confirm_itself():
    assert after(13).support(13, moved=False) == 0.0
    assert after(12, 13).support(13, moved=False) == 0.5


def test_cleared():
    consistency = after(10, 11, 12)
    consistency.clear()
    assert consistency.support(13, moved=True) == 0.0
