# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Images that support those after them."""

from hdc_place_recognition.verification.settings import VerificationSettings
from hdc_place_recognition.verification.temporal import TemporalSupport
import pytest

STRONG, WEAK = 3.0, 1.0


def apart(first: int, second: int) -> int:
    return abs(first - second)


def after(*places: int, strength: float = STRONG) -> TemporalSupport:
    support = TemporalSupport(VerificationSettings())
    for place in places:
        support.remember(place, strength)
    return support


@pytest.mark.parametrize('places', [(10, 11, 12), (16, 15, 14)])
def test_neighboring_places_support_in_either_direction(places):
    assert after(*places).of(13, True, apart) == 1.0


def test_isolated_is_not_supported():
    assert after(50, 90, 20).of(13, True, apart) == 0.0
    assert after().of(13, True, apart) == 0.0


def test_one_supporter_is_half_of_enough():
    assert after(90, 90, 12).of(13, True, apart) == 0.5


def test_weak_images_support_nothing():
    assert after(10, 11, 12, strength=WEAK).of(13, True, apart) == 0.0


def test_older_images_may_be_further_away_up_to_three():
    assert after(9).of(13, True, apart) == 0.5
    assert after(8).of(13, True, apart) == 0.0
    assert after(8, 90).of(13, True, apart) > 0.0
    assert after(13, 90, 90, 90).of(13, True, apart) == 0.0


def test_an_image_does_not_confirm_itself():
    assert after(13).of(13, False, apart) == 0.0
    assert after(12, 13).of(13, False, apart) == 0.5


def test_keyframes_of_another_traverse_are_not_supported():
    support = after(10, 11, 12)
    assert support.of(13, True, lambda first, second: None) == 0.0
    support_of_two = support.of(
        13, True, lambda first, second: None if second < 12 else apart(13, second)
    )
    assert support_of_two == 0.5
