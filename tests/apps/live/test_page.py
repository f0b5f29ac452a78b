"""The page alone in a real browser: keys of all keyboards, screens of all sizes, servers that go.

There is no robot behind it, and nothing to draw: what is told of one stands still.
"""

import json

import pytest

pytest.importorskip("websockets", reason="the extra teleop is not installed: no websockets")

from pages import Page

from poise.apps.live._front import Front

STATUS = {
    "robot": "still", "source": "browser", "kind": "feet",
    "limits": {"height": [-0.1, 0.02], "torso": [0.2, 0.4, 0.5], "turns": [0.2, 0.6]},
    "asked": {"height": 0.0, "torso": [0.0, 0.0, 0.0], "turns": [0.0, 0.0]},
    "time": 1.0, "mode": "D", "modeText": "double support", "device": "OK", "deviceText": "ok",
    "zmp": [0.0, 0.0], "zmpReference": [0.0, 0.0], "com": [0.0, 0.0, 0.7],
    "soles": [[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]], "handles": [[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]],
    "heading": 0.0, "hands": [[0.1, 0.3, 0.7], [0.1, -0.3, 0.7]], "handsDo": ["REST", "REST"],
    "handTurns": [None, None], "gaze": "REST", "target": None,
    "polygon": [[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.1, -0.1]], "bodies": [], "turns": [],
    "margin": 0.1, "loads": [300.0, 300.0], "tilt": 0.0, "fallen": False, "paused": False,
    "speed": 1.0, "realTimeFactor": 1.0, "take": "take-001.teleop",
}  # fmt: skip


class Still:
    """A desk of a robot that stands still; what it is told is kept."""

    def __init__(self):
        self.told, self.orders = dict(STATUS), []

    def order(self, text):
        self.orders.append(json.loads(text))

    def left(self):
        pass

    def status(self):
        return self.told

    def file(self, name):
        return None


@pytest.fixture
def desk():
    return Still()


@pytest.fixture
def front(desk):
    made = Front(desk, port=0, shapes={})
    made.start()
    yield made
    made.stop()


def typed(page, kind, key, code, **held):
    """An event of the keyboard, such as one that no Linux makes; whether the page took it."""
    event = json.dumps({"cancelable": True, "key": key, "code": code, **held})
    return page.ask(f"!window.dispatchEvent(new KeyboardEvent('{kind}', {event}))")


HELD_KEYS = "[keys.left, keys.right, ...keys.arrows]"


def test_what_a_browser_does_with_a_key_that_modifies_another_moves_nothing(plain_browser, front):
    with Page(plain_browser, front.drive_url) as page:
        for modifier in ("ctrlKey", "metaKey", "altKey"):
            for key, code in (("e", "KeyE"), ("ArrowLeft", "ArrowLeft")):
                assert not typed(page, "keydown", key, code, **{modifier: True})
                assert page.ask(HELD_KEYS) == [False, False]
        # A Mac does not say that the arrow was let go while Command was held.
        typed(page, "keydown", "ArrowUp", "ArrowUp")
        typed(page, "keydown", "Meta", "MetaLeft", metaKey=True)
        assert page.ask(HELD_KEYS) == [False, False, "ArrowUp"]
        typed(page, "keyup", "Meta", "MetaLeft")
        assert page.ask(HELD_KEYS) == [False, False]
        # A foot that is held is let go with whatever else is held by then.
        typed(page, "keydown", "e", "KeyE")
        typed(page, "keyup", "e", "KeyE", ctrlKey=True)
        assert page.ask(HELD_KEYS) == [False, False]


def test_letters_are_known_by_their_place_where_they_are_no_latin_ones(plain_browser, front):
    with Page(plain_browser, front.drive_url) as page:
        assert typed(page, "keydown", "\u0439", "KeyQ")
        assert page.ask(HELD_KEYS) == [True, False]
        typed(page, "keyup", "\u0439", "KeyQ")
        # Where Latin letters stand elsewhere it is what is written on the key that counts.
        assert typed(page, "keydown", "q", "KeyA")
        assert page.ask(HELD_KEYS) == [True, False]
        typed(page, "keyup", "q", "KeyA")
        assert page.ask(HELD_KEYS) == [False, False]
