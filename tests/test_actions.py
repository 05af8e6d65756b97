"""The keys of the page."""

from collections import Counter

from app.debugger.actions import ACTIONS, VERTEX_KEYS

CAMERA = [(key, None) for key in "WASDQE"]


def test_no_key_means_two_things():
    bound = [key for action in ACTIONS for key in action.keys] + [(key, None) for key, _ in VERTEX_KEYS] + CAMERA
    assert [key for key, count in Counter(bound).items() if count > 1] == []
