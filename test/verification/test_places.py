# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which keyframes may be rivals, with and without links between visits."""

from hdc_place_recognition.verification.places import PlaceLinks
import pytest


def apart(first: int, second: int) -> int:
    return abs(first - second)


def linked(*pairs: tuple[int, int]) -> PlaceLinks:
    links = PlaceLinks(10)
    for later, earlier in pairs:
        links.accept(later, earlier)
    return links


def test_near_keyframes_are_no_rivals():
    links = linked()
    assert not links.distinct(30, 40, apart) and links.distinct(30, 41, apart)
    assert not links.distinct(30, 30, apart)


def test_keyframes_of_different_traverses_may_be_rivals():
    assert linked().distinct(30, 31, lambda first, second: None)


def test_a_place_that_was_visited_twice_is_no_rival_of_itself():
    links = linked((100, 20))
    assert not links.distinct(100, 21, apart) and not links.distinct(25, 100, apart)
    assert links.distinct(100, 31, apart) and links.distinct(101, 20, apart)


def test_links_lead_to_the_first_visit():
    links = linked((100, 20), (200, 100), (300, 25))
    assert not links.distinct(200, 20, apart) and not links.distinct(200, 100, apart)
    # Both were accepted for keyframes of one place.
    assert not links.distinct(200, 300, apart)
    assert links.distinct(200, 60, apart)


def test_an_evicted_keyframe_has_no_link():
    links = linked((200, 20))
    links.evict(200)
    links.evict(999)
    assert links.distinct(200, 20, apart)


@pytest.mark.parametrize('pair', [(100, 200), (200, 100)])
def test_visits_of_an_evicted_keyframe_are_still_of_one_place(pair):
    links = linked((100, 20), (200, 20))
    links.evict(20)

    def unless_evicted(first: int, second: int) -> int | None:
        return None if 20 in (first, second) else apart(first, second)

    assert not links.distinct(*pair, unless_evicted)
