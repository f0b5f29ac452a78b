"""The page alone in a real browser: keys of all keyboards, screens of all sizes, servers that go.

There is no robot behind it, and nothing to draw: what is told of one stands still.
"""

import json
import time

import pytest

pytest.importorskip("websockets", reason="the extra teleop is not installed: no websockets")

from operators import wait_for
from pages import Page

from poise.apps.live import _front as fronts, _seat as seats
from poise.apps.live._front import Front


@pytest.fixture
def front(still_front):
    return still_front


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


def test_buttons_that_are_held_are_held_by_keys_too(plain_browser, front):
    with Page(plain_browser, front.drive_url) as page:
        for name, held in (("rest", "keys.rest"), ("lift-left", "keys.left")):
            for key in (" ", "Enter"):
                page.ask(f"part('{name}').focus(); 0")
                page.page.keyboard.down(key)
                assert page.ask(held)
                page.page.keyboard.up(key)
                assert not page.ask(held)
        # Who goes elsewhere meanwhile has let go.
        page.page.keyboard.down(" ")
        assert page.ask("keys.left")
        page.page.keyboard.press("Tab")
        assert not page.ask("keys.left")


def test_whatever_can_be_pressed_has_a_name_in_words(plain_browser, front):
    with Page(plain_browser, front.drive_url, **PHONE) as page:
        page.page.keyboard.press("?")
        for name in (
            "Help", "Close", "Got it", "Move left", "Move forward", "Move back", "Move right",
            "Push to the robot's left", "Push forward", "Push back", "Push to the robot's right",
        ):  # fmt: skip
            assert page.page.get_by_role("button", name=name, exact=True).count() == 1, name
        assert page.page.get_by_role("meter", name="Balance margin").count() == 1
        assert page.page.get_by_role("img", name="Plot").count() == 2


PHONE = {"viewport": {"width": 844, "height": 390}, "is_mobile": True, "has_touch": True}
"""A phone that lies on its side."""


def edges(page, name):
    """Top and bottom of a part of the page, in pixels of the screen."""
    return page.ask(f"(({{top, bottom}}) => [top, bottom])(part('{name}').getBoundingClientRect())")


def test_on_a_phone_that_lies_feet_can_be_held_and_the_help_can_be_read(plain_browser, front):
    with Page(plain_browser, front.drive_url, **PHONE) as page:
        page.page.keyboard.press("?")
        for name in ("lift-left", "lift-right", "hint", "help"):
            top, bottom = edges(page, name)
            assert 0 <= top < bottom <= PHONE["viewport"]["height"], name
        page.ask("part('help').scrollTop = 1e6; 0")
        last = page.ask("part('help').lastElementChild.getBoundingClientRect().bottom")
        assert last <= PHONE["viewport"]["height"]


@pytest.mark.parametrize("device", [{}, {"viewport": {"width": 390, "height": 844}}])
def test_no_button_moves_whatever_is_told(plain_browser, front, desk, device):
    with Page(plain_browser, front.drive_url, **device) as page:
        page.wait("part('device').textContent === 'ok'", "the device")
        before = [edges(page, name) for name in ("lift-left", "pause", "reset")]
        desk.told = desk.told | {
            "deviceText": "no new sample for a moment: the last one holds",
            "handsDo": ["REACH", "REACH"], "realTimeFactor": 0.2, "speed": 0.25,
            "modeText": "the robot stepped by itself; take hold of each foot anew",
        }  # fmt: skip
        page.wait("part('device').textContent.startsWith('no new')", "the words")
        assert [edges(page, name) for name in ("lift-left", "pause", "reset")] == before


@pytest.mark.parametrize("kind", ["feet", "velocity"])
@pytest.mark.parametrize("width", [390, 800, 1280])
def test_nothing_is_wider_than_the_window(plain_browser, front, desk, width, kind):
    desk.told = desk.told | {"kind": kind}
    with Page(plain_browser, front.drive_url, viewport={"width": width, "height": 844}) as page:
        page.wait(f"document.body.dataset.kind === '{kind}'", "the kind")
        for key in ("", "?"):
            page.ask(f"if ('{key}') help(true); document.querySelector('details').open = true; 0")
            assert page.ask("document.documentElement.scrollWidth") <= width
            assert page.ask("document.querySelector('aside').scrollWidth") <= width
            ends = "[...document.querySelectorAll('*')].map((e) => e.getBoundingClientRect().right)"
            assert page.ask(f"Math.max(...{ends})") <= width


def test_who_drives_a_walk_reads_nothing_of_feet(plain_browser, front, desk):
    desk.told = desk.told | {"kind": "velocity", "modeText": "standing"}
    with Page(plain_browser, front.drive_url) as page:
        page.wait("document.body.dataset.kind === 'velocity'", "the kind")
        page.page.keyboard.press("?")
        told = page.ask("document.body.innerText")
        assert "Drive the robot" in told
        assert "the robot walks" in told
        assert "foot" not in told.lower()
        assert "feet" not in told.lower()


def test_modes_are_words(plain_browser, front, desk):
    with Page(plain_browser, front.drive_url) as page:
        for mode, text in (("TL", "weight to left"), ("SR", "on right foot")):
            desk.told = desk.told | {"mode": mode}
            page.wait(f"document.querySelector('.now').textContent === '{text}'", mode)


def test_after_a_lost_device_what_is_held_has_to_be_pressed_again(plain_browser, front, desk):
    with Page(plain_browser, front.drive_url) as page:
        page.page.keyboard.down("e")
        desk.answer = {"echo": 0.0, "forces": None, "again": True}
        page.wait("part('banner').textContent.includes('let go and press again')", "the words")
        desk.answer = {"echo": 0.0, "forces": None}
        page.wait("part('banner').hidden", "the end of it")
        # A window that was left lets go of everything; the key is down all the same.
        page.ask("window.dispatchEvent(new Event('blur')); 0")
        page.ask(
            "window.dispatchEvent(new KeyboardEvent('keydown',"
            " {key: 'e', code: 'KeyE', repeat: true})); 0"
        )
        assert "let go and press again" in page.text("said")
        assert page.ask(HELD_KEYS) == [False, False]


WATCHES = "part('role').textContent === 'you watch'"
STALE = "document.body.dataset.stale === 'true'"
SHINES = "getComputedStyle(document.querySelector('dl')).opacity === '1'"


def test_what_nothing_new_has_come_of_looks_old_and_says_since_when(plain_browser, front):
    with Page(plain_browser, front.drive_url) as page:
        page.wait(f"!({STALE}) && {SHINES}", "the values")
        # The connection breaks.
        page.ask("window.back = join; join = () => {}; socket.close(); 0")
        page.wait(f"{STALE} && !({SHINES})", "the values to look old")
        at = page.ask("new Date(heardAt).toLocaleTimeString()")
        # A connection that is closing is not closed yet: the other end has to agree.
        page.wait(f"part('banner').textContent.includes('What is shown is of {at}.')", "the time")
        page.wait(f"part('mode-text').textContent.endsWith('since {at}.')", "the words")
        page.ask("back(); 0")
        page.wait(f"!({STALE}) && {SHINES} && part('banner').hidden", "the values")
        assert page.text("mode-text") == "standing on both feet"
        # It holds, and says nothing.
        page.ask("window.ear = socket.onmessage; socket.onmessage = null; 0")
        page.wait(STALE, "the values to look old")
        page.wait("part('banner').textContent.startsWith('Nothing has come')", "the words")
        page.ask("socket.onmessage = ear; 0")
        page.wait(f"!({STALE}) && part('banner').hidden", "the values")


def test_a_connection_that_is_ended_says_why(plain_browser, front, monkeypatch):
    monkeypatch.setattr(fronts, "_MOST_WATCHERS", 1)
    with Page(plain_browser, front.watch_url) as page:
        assert page.text("role") == "you watch"
        other = plain_browser.new_page()
        other.goto(front.watch_url)
        for there in ("part('banner').textContent.includes('look on already')", WATCHES):
            wait_for(lambda there=there: other.evaluate(there), there)
            page.page.goto("about:blank")
        other.close()


@pytest.mark.parametrize("size", [(1280, 800), (853, 470), (683, 340), (640, 400), (400, 600)])
def test_the_hint_lies_neither_on_the_robot_nor_on_what_holds_a_foot(plain_browser, front, size):
    """Windows of which some are what is left of others that are seen at 150 or 200%."""
    width, height = size
    with Page(plain_browser, front.drive_url, viewport={"width": width, "height": height}) as page:
        box = "(({left, right, top, bottom}) => [left, right, top, bottom])"
        view, told = (
            page.ask(f"{box}(part('{name}').getBoundingClientRect())") for name in ("view", "hint")
        )
        assert told[1] <= view[0] or view[1] <= told[0] or told[2] >= view[3] - 1
        assert view[3] - view[2] > 0.35 * height
        for name in ("lift-left", "lift-right"):
            assert page.ask(
                f"""(({{left, right, top, bottom}}) => part("{name}").contains(
                  document.elementFromPoint(0.5 * (left + right), 0.5 * (top + bottom))
                ))(part("{name}").getBoundingClientRect())"""
            ), name
        assert edges(page, "hint")[1] <= height
        page.page.keyboard.press("?")
        page.ask("part('help').scrollTop = 1e6; 0")
        assert edges(page, "help")[1] <= height
        last = "part('help').lastElementChild"
        assert page.ask(f"{last}.getBoundingClientRect().bottom") <= height


def test_who_lost_the_connection_takes_the_seat_again_when_its_ghost_is_silent(
    plain_browser, front, monkeypatch
):
    monkeypatch.setattr(seats, "SILENT_FOR", 0.5)
    with Page(plain_browser, front.drive_url) as page:
        assert page.text("role") == "you drive"
        # To the server the old connection lives on, as behind a tunnel that has not noticed yet.
        page.ask(
            """(() => {
              const ghost = socket, lost = ghost.onclose;
              ghost.onclose = ghost.onmessage = null;
              window.haunting = setInterval(() => ghost.send('{"do": "drive"}'), 30);
              lost(new CloseEvent("close"));
            })()"""
        )
        page.wait("part('banner').textContent.includes('Somebody else')", "the ghost")
        page.ask("clearInterval(haunting); 0")
        page.wait("part('role').textContent === 'you drive'", "the seat")
        assert not page.ask("part('controls').disabled")


def test_who_came_second_does_not_take_a_seat_that_gets_free(plain_browser, front):
    with (
        Page(plain_browser, front.drive_url) as first,
        Page(plain_browser, front.drive_url) as second,
    ):
        assert second.text("role") == "you watch"
        second.wait("part('banner').textContent.startsWith('Somebody else')", "the reason")
        first.page.goto("about:blank")
        second.wait("!newest.driven", "the empty seat")
        time.sleep(1.5)
        assert second.text("role") == "you watch"
        second.wait("part('banner').textContent.startsWith('Nobody drives now')", "the news")


def test_the_page_of_an_earlier_run_is_loaded_anew(plain_browser, front, desk):
    with Page(plain_browser, front.drive_url) as page:
        front.stop()
        page.wait("part('role').textContent === 'no connection'", "the end")
        desk.told = desk.told | {"robot": "another"}
        later = Front(desk, port=front.port, shapes={})
        try:
            with page.page.expect_event("load"):
                later.start()
            page.wait("part('robot').textContent === 'another'", "the other robot")
            assert "earlier run" in page.text("banner")
        finally:
            later.stop()


def test_who_comes_too_late_over_a_slow_connection_reads_why(plain_browser, front, desk):
    with Page(plain_browser, front.drive_url) as page:
        desk.answer = {"echo": 0.0, "forces": None, "old": 0.02}
        page.wait("part('latency').textContent.endsWith('ms')", "an answer")
        assert page.text("said").strip() == ""
        desk.answer = {"echo": 0.0, "forces": None, "late": 0.7351}
        page.wait("part('said').textContent.includes('comes 0.7 s late')", "the words")
        assert page.errors == []
