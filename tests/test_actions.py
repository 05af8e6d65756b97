"""The keys of the page."""

from collections import Counter

from app.debugger.actions import ACTIONS, VERTEX_KEYS, first_keys, key_list

CAMERA = [(key, None) for key in "WASDQE"]


def test_no_key_means_two_things():
    bound = [key for action in ACTIONS for key in action.keys] + [(key, None) for key, _ in VERTEX_KEYS] + CAMERA
    assert [key for key, count in Counter(bound).items() if count > 1] == []


def test_a_newcomers_keys_are_those_of_the_list_of_keys():
    every = {(key, meaning) for keys, meaning in key_list("sequential") for key in (keys, keys.split(", ")[0])}
    first = first_keys()
    assert set(first) <= every
    assert ("F11", "Step one iteration") in first
    assert ("?", "Keys") in first
