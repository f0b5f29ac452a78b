"""The page in a real browser: keys, gamepads, screens of all sizes, connections that end.

There is no robot behind it: its status is constant.
"""

import json

import pytest

pytest.importorskip("websockets", reason="the extra teleop is not installed: no websockets")

from operators import says, wait_for
from pages import Page

from poise.apps.live import _front as fronts
from poise.apps.live._front import Front


@pytest.fixture
def front(still_front):
    return still_front


@pytest.fixture
def page(plain_browser, front):
    """The operator's page, without a picture."""
    with Page(plain_browser, front.drive_url) as page:
        yield page
        assert page.errors == []


def typed(page, kind, key, code, **held):
    """An event of the keyboard, such as one that no Linux makes; whether the page took it."""
    event = json.dumps({"cancelable": True, "key": key, "code": code, **held})
    return page.ask(f"!window.dispatchEvent(new KeyboardEvent('{kind}', {event}))")


def press_gamepad(page, *buttons, axes=(), more=""):
    """Press buttons of a gamepad at the page's computer."""
    pressed = [{"pressed": i in buttons} for i in range(16)]
    pad = json.dumps({"connected": True, "mapping": "standard", "axes": axes, "buttons": pressed})
    page.ask(f"navigator.getGamepads = () => [{{...{pad}, {more}}}]; 0")


DRAGGED = """
  view = {
    hands: () => [{position: [0, 0, 0.1], clutch: true}, {position: [0, 0, 0], clutch: false}],
    drags: () => [null, [0, -0.1, 0.05]], show() {}, allow() {}, release() {},
  };
  0
"""
"""A picture in which the left hand's and the right foot's handle are dragged."""

HELD_KEYS = "[keys.left, keys.right, ...keys.arrows]"


def test_what_a_browser_does_with_a_key_that_modifies_another_moves_nothing(page):
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


# Letters that are not Latin are known by their place; of Latin ones it is what the key says.
@pytest.mark.parametrize(("key", "code"), [("\u0439", "KeyQ"), ("q", "KeyA")])
def test_letters_of_all_keyboards(page, key, code):
    assert typed(page, "keydown", key, code)
    assert page.ask(HELD_KEYS) == [True, False]
    typed(page, "keyup", key, code)
    assert page.ask(HELD_KEYS) == [False, False]


def test_buttons_that_are_held_are_held_by_keys_too(page):
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


def test_a_key_that_walks_moves_no_slider(page):
    slider = "document.querySelector('input[type=range]')"
    page.ask(f"{slider}.focus(); 0")
    before = page.ask(f"{slider}.value")
    for _ in range(6):
        page.page.keyboard.down("ArrowDown")
    page.page.keyboard.up("ArrowDown")
    assert page.ask(f"{slider}.value") == before
    assert page.ask("keys.arrows.size") == 0
    assert "hold Q or E" in page.text("said")


@pytest.mark.parametrize(("key", "code", "which"), [("c", "KeyC", 0), ("\u043c", "KeyV", 1)])
def test_a_hand_is_held_by_a_key_and_moved_by_arrows_and_two_letters(page, desk, key, code, which):
    grip = [which == 0, which == 1]
    page.wait("grips", "the hands")
    says(desk, "nothing", "grip", [False, False])
    assert typed(page, "keydown", key, code)
    says(desk, "the grip", "grip", grip)
    for name, letter, way in (
        ("ArrowUp", "ArrowUp", [1, 0, 0]), ("ArrowDown", "ArrowDown", [-1, 0, 0]),
        ("ArrowLeft", "ArrowLeft", [0, 1, 0]), ("ArrowRight", "ArrowRight", [0, -1, 0]),
        ("t", "KeyT", [0, 0, 1]), ("b", "KeyB", [0, 0, -1]),
    ):  # fmt: skip
        assert typed(page, "keydown", name, letter)
        says(desk, name, "reach", way)
        typed(page, "keyup", name, letter)
    # Arrows that moved a hand move neither robot nor foot when the hand is released.
    typed(page, "keydown", "ArrowUp", "ArrowUp")
    typed(page, "keyup", key, code)
    says(desk, "letting go", "grip", [False, False])
    assert page.ask("pad().move") == [0, 0]
    typed(page, "keyup", "ArrowUp", "ArrowUp")
    typed(page, "keydown", key, code)
    says(desk, "the grip anew", "grip", grip)
    page.ask("window.dispatchEvent(new Event('blur')); 0")
    says(desk, "letting go with the window", "grip", [False, False])


def test_a_button_holds_a_hand_for_who_presses_it_by_keys(page, desk):
    page.wait("grips", "the hands")
    for side, grip in (("left", [True, False]), ("right", [False, True])):
        assert page.page.get_by_role("button", name=f"Hold {side} hand", exact=True).count() == 1
        page.ask(f"part('hand-{side}').focus(); 0")
        page.page.keyboard.down(" ")
        page.page.keyboard.down("t")
        says(desk, "the way", "reach", [0, 0, 1])
        says(desk, "the hand", "grip", grip)
        page.page.keyboard.up("t")
        page.page.keyboard.up(" ")
        says(desk, "letting go", "grip", [False, False])
    page.page.keyboard.press("t")
    assert "hold C or V" in page.text("said")


def test_a_key_takes_no_hand_that_is_dragged_and_without_hands_it_does_nothing(page, desk):
    page.wait("grips", "the hands")
    page.ask(DRAGGED)
    page.page.keyboard.down("c")
    assert page.ask("held") == [False, False]
    page.page.keyboard.up("c")
    page.ask("view = null; 0")
    desk.told = desk.told | {"hands": [], "handsDo": []}
    page.wait("!grips", "the robot without hands")
    page.page.keyboard.down("c")
    assert page.ask("held") == [False, False]


def test_a_robot_that_is_driven_walks_by_letters_while_arrows_lead_a_hand(page, desk):
    desk.told = desk.told | {"kind": "velocity", "modeText": "standing"}
    page.wait("grips && driven()", "the hands")
    for key in ("w", "v", "ArrowLeft"):
        page.page.keyboard.down(key)
    says(desk, "the hand", "reach", [0, 1, 0])
    says(desk, "the walk", "move", [1, 0])
    page.page.keyboard.up("w")
    page.page.keyboard.down("q")
    says(desk, "the turn", "turn", 1)
    page.page.keyboard.press("?")
    told = page.ask("document.body.innerText")
    assert "Drive the robot" in told
    assert "the robot walks" in told
    assert not {"foot", "feet"} & set(told.lower().split())


def test_keys_bend_the_body(page, desk):
    page.wait("bendable()", "the limits")
    for place, (more, less) in enumerate(("rf", "hg", "ik", "jl", "uo")):
        for key, sign in ((more, 1), (less, -1)):
            page.page.keyboard.down(key)
            says(desk, key, "bend", [sign * (i == place) for i in range(5)])
            page.page.keyboard.up(key)
            says(desk, "letting go", "bend", None)
    assert "held" in page.text("said")
    page.page.keyboard.down("n")
    says(desk, "the key for neutral", "neutral", True)
    page.page.keyboard.up("n")
    desk.told["limits"] = desk.told["limits"] | {"torso": [0.0, 0.0, 0.0]}
    page.wait("newest.limits.torso[2] === 0", "the limits")
    page.page.keyboard.press("j")
    assert "only the height" in page.text("said")


def test_a_slider_moves_the_body_and_all_pages_show_where_it_is(plain_browser, page, front, desk):
    page.ask("document.querySelector('summary').click()")
    page.wait("bendable() && part('bend-height').offsetHeight > 0", "the slider")
    slider = "part('bend-height')"
    page.ask(f"{slider}.value = -0.05; {slider}.dispatchEvent(new Event('input')); 0")
    body = {"height": -0.05, "torso": [0, 0, 0], "turns": [0, 0]}
    says(desk, "the slider", "body", body)
    desk.told = desk.told | {"asked": body | {"torso": [0.1, 0, 0], "turns": [0, -0.1]}}
    page.wait(
        "part('body-now').textContent === '−5 cm, tilt 6° right, right foot 6° right'", "the words"
    )
    with Page(plain_browser, front.watch_url) as watcher:
        watcher.wait("part('bent-height').textContent === '−5 cm'", "the watcher's page")
        assert watcher.ask("part('bends').disabled")


def test_a_gamepad_of_the_browsers_computer_leads_and_does_not_wait_for_the_next_beat(page, desk):
    page.ask("clearInterval(beating); 0")
    press_gamepad(page, 4, 5, axes=[-0.5, -1, 0.5, 0.1])
    says(desk, "the feet", "lift", [True, True])
    says(desk, "the left stick", "move", [1, 0.5])
    says(desk, "the right stick", "second", [0, -0.5])
    press_gamepad(page, 1, 12, 14)
    says(desk, "the D-pad", "bend", [0, 0, 1, 1, 0])
    # One that can shake does so when a foot lands.
    more = "vibrationActuator: {playEffect: (kind) => shaken.push(kind)}"
    page.ask("window.shaken = []; 0")
    press_gamepad(page, more=more)
    page.wait("landings === 0", "the first status")
    desk.told = desk.told | {"landings": 1}
    page.wait("shaken.join() === 'dual-rumble'", "the shaking")
    page.ask("navigator.getGamepads = () => [{connected: true, mapping: '', axes: [0, 0, -1]}]; 0")
    page.wait("part('said').textContent.includes('does not know where that gamepad')", "a hint")
    assert page.ask("[pad().turn, pad().second, pad().upright]") == [0, [0, 0], False]


def test_keys_buttons_and_handles_do_not_wait_for_the_next_beat(page, desk):
    page.ask("clearInterval(looking); clearInterval(beating); 0")
    for key, code, lift in (("e", "KeyE", [False, True]), ("q", "KeyQ", [True, False])):
        typed(page, "keydown", key, code)
        says(desk, key, "lift", lift)
        typed(page, "keyup", key, code)
        says(desk, "its release", "lift", [False, False])
    page.ask("setInterval(look, QUICK); " + DRAGGED)
    says(desk, "the handle", "feet", [None, {"position": [0, -0.1, 0.05]}])
    page.ask("view = null; 0")


HIDE = """
  Object.defineProperty(document, "hidden", {{configurable: true, get: () => {hidden}}});
  document.dispatchEvent(new Event("visibilitychange"));
  0
"""


def test_a_page_that_is_hidden_sends_nothing_and_lets_go(page, desk, front, monkeypatch):
    monkeypatch.setattr(fronts, "SILENT_FOR", 0.2)
    page.page.keyboard.down("e")
    says(desk, "the key", "lift", [False, True])
    page.ask(HIDE.format(hidden="true"))
    wait_for(lambda: not front.seat.taken, "the silence")
    page.ask(HIDE.format(hidden="false"))
    says(desk, "its waking", "lift", [False, False])
    wait_for(lambda: front.seat.taken, "the seat")


def test_buttons_send_orders_and_a_kept_copy_is_offered(page, desk):
    for name, order in (
        ('[data-push="left"]', {"do": "push", "value": "left"}),
        ("#pause", {"do": "pause", "value": True}),
        ("#slow", {"do": "slow", "value": True}),
        ("#reset", {"do": "reset"}),
    ):
        page.ask(f"document.querySelector('{name}').click()")
        wait_for(lambda order=order: order in desk.orders, name)
    desk.answer = {"kept": "kept-001.mcap"}
    page.ask("document.querySelector('#keep').click()")
    page.wait("part('said').textContent.includes('kept as kept-001.mcap')", "the copy")
    page.ask("part('help-open').click()")
    assert not page.ask("part('help').hidden")
    page.ask("part('help-close').click()")
    assert page.ask("part('help').hidden")


@pytest.mark.parametrize(
    ("query", "words"), [("", "Only the address with the token"), ("?token=wrong", "wrong")]
)
def test_without_the_token_one_sees_but_cannot_command(plain_browser, front, desk, query, words):
    with Page(plain_browser, front.watch_url + query) as page:
        page.wait(f"part('banner').textContent.includes('{words}')", "the reason")
        assert page.text("role") == "you watch"
        assert page.ask("part('controls').disabled")
        page.page.keyboard.down("e")
        # What the page would send without its locks.
        page.ask("driving = true; beat(); send({do: 'pause', value: true}); 0")
        page.wait("part('said').textContent.includes('watching')", "the refusal")
        assert desk.orders == []
        desk.told = desk.told | {"device": "LOST"}
        page.wait("part('device').textContent === 'nobody drives'", "the words")


PHONE = {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True}
LYING = PHONE | {"viewport": {"width": 844, "height": 390}}


def edges(page, name):
    """Left, right, top and bottom of a part of the page, in pixels of the screen."""
    return page.ask(
        "(({left, right, top, bottom}) => [left, right, top, bottom])"
        f"(part('{name}').getBoundingClientRect())"
    )


def test_whatever_can_be_pressed_has_a_name_in_words(plain_browser, front):
    with Page(plain_browser, front.drive_url, **LYING) as page:
        page.page.keyboard.press("?")
        for name in (
            "Help", "Close", "Got it", "Move left", "Move forward", "Move back", "Move right",
            "Push to the robot's left", "Push forward", "Push back", "Push to the robot's right",
        ):  # fmt: skip
            assert page.page.get_by_role("button", name=name, exact=True).count() == 1, name
        assert page.page.get_by_role("meter", name="Balance margin").count() == 1
        assert page.page.get_by_role("img", name="Plot").count() == 2


def test_on_a_phone_the_robot_has_the_upper_half_and_fingers_hold_a_foot(
    plain_browser, front, desk
):
    width, height = PHONE["viewport"].values()
    with Page(plain_browser, front.drive_url, **PHONE) as page:
        left, right, top, low = edges(page, "view")
        assert (left, right, top) == (0, width, 0)
        assert low > 0.5 * height
        for name in ("lift-left", "lift-right"):
            left, right, top, bottom = edges(page, name)
            assert low <= top < bottom <= edges(page, "hint")[2]
            assert min(right - left, bottom - top) >= 40
        assert page.ask("document.querySelector('[data-arrow=ArrowUp]').offsetHeight") >= 40
        point = {"x": 0.5 * (left + right), "y": 0.5 * (top + bottom)}
        touch = page.page.context.new_cdp_session(page.page)
        for kind, points, lift in (("Start", [point], True), ("End", [], False)):
            touch.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": points})
            says(desk, kind, "lift", [False, lift])


@pytest.mark.parametrize("kind", ["feet", "velocity"])
def test_nothing_is_wider_than_the_window_and_no_button_moves_whatever_is_told(page, desk, kind):
    plain = desk.told | {"kind": kind}
    for width in (390, 800, 1280):
        page.page.set_viewport_size({"width": width, "height": 844})
        desk.told = plain
        page.wait(f"document.body.dataset.kind === '{kind}'", "the kind")
        page.wait("part('device').textContent === 'ok'", "the device")
        before = [edges(page, name) for name in ("lift-left", "pause", "reset")]
        desk.told = plain | {
            "deviceText": "no new sample for a moment: the last one holds",
            "handsDo": ["REACH", "REACH"], "realTimeFactor": 0.2, "speed": 0.25,
            "modeText": "the robot stepped by itself; take hold of each foot anew",
        }  # fmt: skip
        page.wait("part('device').textContent.startsWith('no new')", "the words")
        assert [edges(page, name) for name in ("lift-left", "pause", "reset")] == before
        for shown in ("false", "true"):
            page.ask(f"help({shown}); document.querySelector('details').open = {shown}; 0")
            assert page.ask("document.documentElement.scrollWidth") <= width
            assert page.ask("document.querySelector('aside').scrollWidth") <= width
            ends = "[...document.querySelectorAll('*')].map((e) => e.getBoundingClientRect().right)"
            assert page.ask(f"Math.max(...{ends})") <= width
        page.ask("help(false); document.querySelector('details').open = false; 0")


# Some of these are the sizes of others zoomed to 150 or 200%.
WINDOWS = [(1280, 800), (853, 470), (683, 340), (640, 400), (400, 600)]


@pytest.mark.parametrize("device", [{}, LYING], ids=["window", "phone"])
def test_the_hint_lies_neither_on_the_robot_nor_on_what_holds_a_foot(plain_browser, front, device):
    with Page(plain_browser, front.drive_url, **device) as page:
        for width, height in [(844, 390)] if device else WINDOWS:
            page.page.set_viewport_size({"width": width, "height": height})
            view, told = edges(page, "view"), edges(page, "hint")
            assert told[1] <= view[0] or view[1] <= told[0] or told[2] >= view[3] - 1
            assert view[3] - view[2] > 0.35 * height
            for name in ("lift-left", "lift-right"):
                left, right, top, bottom = edges(page, name)
                middle = f"{0.5 * (left + right)}, {0.5 * (top + bottom)}"
                there = f"part('{name}').contains(document.elementFromPoint({middle}))"
                assert page.ask(there), name
            assert told[3] <= height
            page.ask("help(true); part('help').scrollTop = 1e6; 0")
            assert edges(page, "help")[3] <= height
            last = page.ask("part('help').lastElementChild.getBoundingClientRect().bottom")
            assert last <= height
            page.ask("help(false)")


def test_modes_are_words(page, desk):
    for mode, text in (("TL", "weight to left"), ("SR", "on right foot")):
        desk.told = desk.told | {"mode": mode}
        page.wait(f"document.querySelector('.now').textContent === '{text}'", mode)


def test_after_a_lost_device_what_is_held_has_to_be_pressed_again(page, desk):
    page.page.keyboard.down("e")
    desk.answer = {"echo": 0.0, "forces": None, "again": True}
    page.wait("part('banner').textContent.includes('let go and press again')", "the words")
    desk.answer = {"echo": 0.0, "forces": None}
    page.wait("part('banner').hidden", "the end of it")
    # A window that was left lets go of everything; the key is down all the same.
    page.ask("window.dispatchEvent(new Event('blur')); 0")
    typed(page, "keydown", "e", "KeyE", repeat=True)
    assert "let go and press again" in page.text("said")
    assert page.ask(HELD_KEYS) == [False, False]


def test_who_comes_too_late_over_a_slow_connection_reads_why(page, desk):
    desk.answer = {"echo": 0.0, "forces": None, "old": 0.02}
    page.wait("part('latency').textContent.endsWith('ms')", "an answer")
    assert page.text("said").strip() == ""
    desk.answer = {"echo": 0.0, "forces": None, "late": 0.7351}
    page.wait("part('said').textContent.includes('comes 0.7 s late')", "the words")


STALE = "document.body.dataset.stale === 'true'"
SHINES = "getComputedStyle(document.querySelector('dl')).opacity === '1'"


def test_what_nothing_new_has_come_of_looks_old_and_says_since_when(page):
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


def test_who_lost_the_connection_takes_the_seat_again_when_its_ghost_is_silent(page, monkeypatch):
    monkeypatch.setattr(fronts, "SILENT_FOR", 0.5)
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


def test_who_came_second_does_not_take_a_seat_that_gets_free(plain_browser, page, front):
    with Page(plain_browser, front.drive_url) as second:
        assert second.text("role") == "you watch"
        second.wait("part('banner').textContent.startsWith('Somebody else')", "the reason")
        page.page.goto("about:blank")
        second.wait("part('banner').textContent.startsWith('Nobody drives now')", "the news")
        assert second.text("role") == "you watch"
        assert not front.seat.taken


def test_the_page_of_an_earlier_run_is_loaded_anew(plain_browser, page, front, desk, monkeypatch):
    front.stop()
    page.wait("part('role').textContent === 'no connection'", "the end")
    desk.told = desk.told | {"robot": "another"}
    later = Front(desk, port=front.port, shapes={})
    try:
        with page.page.expect_event("load"):
            later.start()
        page.wait("part('robot').textContent === 'another'", "the other robot")
        assert "earlier run" in page.text("banner")
        # A connection that is ended says why.
        monkeypatch.setattr(fronts, "_MOST_WATCHERS", 1)
        other = plain_browser.new_page()
        other.goto(later.watch_url)
        full = "part('banner').textContent.includes('look on already')"
        wait_for(lambda: other.evaluate(full), "the reason")
        other.close()
    finally:
        later.stop()
