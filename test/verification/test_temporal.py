# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Images that support those after them."""

from hdc_place_recognition.verification.settings import VerificationSettings
from hdc_place_recognition.verification.temporal import TemporalSupport
import pytest


def apart(first: int, second: int) -> int:
    return abs(first - second)


def after(*places: int, probability: float = 1.0) -> TemporalSupport:
    support = TemporalSupport(VerificationSettings())
    for place in places:
        support.remember(place, probability)
    return support


@pytest.mark.parametrize('places', [(10, 11, 12), (16, 15, 14)])
def test_neighboring_places_support_in_either_direction(places):
    assert after(*places).of(13, True, apart) == 1.0


def test_isolated_is_not_supported():
    assert after(50, 90, 20).of(13, True, apart) == 0.0
    assert after().of(13, True, apart) == 0.0


def test_one_supporter_is_half_of_enough():
    assert after(90, 90, 12).of(13, True, apart) == 0.5


def test_three_supporters_are_no_more_than_enough():
    assert after(11, 12, probability=1.0).of(13, True, apart) == 1.0
    assert after(11, 12, 13).of(13, True, apart) == 1.0


def test_images_support_by_their_probability():
    support = after(12, probability=0.4)
    assert support.of(13, True, apart) == pytest.approx(0.2)
    support.remember(13, 0.9)
    assert support.of(13, True, apart) == pytest.approx(0.65)
    assert after(10, 11, 12, probability=0.0).of(13, True, apart) == 0.0


def test_older_images_may_be_further_away_up_to_three():
    # By two keyframes for each image, and two more.
    assert after(9).of(13, True, apart) == 0.5 and after(8).of(13, True, apart) == 0.0
    assert after(7, 90).of(13, True, apart) == 0.5 and after(6, 90).of(13, True, apart) == 0.0
    assert after(5, 90, 90).of(13, True, apart) == 0.5
    assert after(13, 90, 90, 90).of(13, True, apart) == 0.0


def test_an_image_does_not_confirm_itself():
    # If nothing moved, the last image was this one; what was before it is as old as it was.
    assert after(13).of(13, False, apart) == 0.0
    assert after(12, 13).of(13, False, apart) == 0.5
    assert after(10, 11, 12, 13).of(13, False, apart) == 1.0


def test_keyframes_of_another_traverse_are_not_supported():
    support = after(10, 11, 12)
    assert support.of(13, True, lambda first, second: None) == 0.0
    half = support.of(13, True, lambda first, second: None if second < 12 else apart(13, second))
    assert half == 0.5


def test_the_last_match_is_remembered():
    assert after().last is None
    support = after(7, 9, probability=0.3)
    assert support.last == (9, 0.3)
