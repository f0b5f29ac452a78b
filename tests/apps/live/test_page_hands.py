"""Hands that are led by keys, in a real browser with a robot behind it that stands still."""

import pytest

pytest.importorskip("websockets", reason="the extra teleop is not installed: no websockets")

from operators import wait_for
from pages import Page


def last(desk):
    """What the page said last."""
    return desk.orders[-1] if desk.orders else {"hands": [None, None]}


def hand(desk, which):
    """Place to which a hand's handle has been dragged [m]; None while it is not."""
    said = last(desk)["hands"][which]
    return said["position"] if said and said["clutch"] else None


def led(desk, which):
    """Direction in which keys send a hand that they hold; None while they do not."""
    said = last(desk)
    return said["reach"] if said.get("grip", [False] * 2)[which] else None


@pytest.mark.parametrize(("key", "code", "which"), [("c", "KeyC", 0), ("\u043c", "KeyV", 1)])
def test_a_hand_is_held_by_a_key_and_moved_by_arrows_and_two_letters(
    plain_browser, still_front, desk, key, code, which
):
    with Page(plain_browser, still_front.drive_url) as page:

        def type_(kind, key, code):
            return page.ask(
                f"!window.dispatchEvent(new KeyboardEvent('{kind}',"
                f" {{cancelable: true, key: '{key}', code: '{code}'}}))"
            )

        page.wait("grips", "the hands")
        wait_for(lambda: desk.orders, "a message")
        assert led(desk, which) is None
        assert type_("keydown", key, code)
        wait_for(lambda: led(desk, which) == [0, 0, 0], "the grip")
        for name, letter, way in (
            ("ArrowUp", "ArrowUp", [1, 0, 0]), ("ArrowDown", "ArrowDown", [-1, 0, 0]),
            ("ArrowLeft", "ArrowLeft", [0, 1, 0]), ("ArrowRight", "ArrowRight", [0, -1, 0]),
            ("t", "KeyT", [0, 0, 1]), ("b", "KeyB", [0, 0, -1]),
        ):  # fmt: skip
            assert type_("keydown", name, letter)
            wait_for(lambda way=way: led(desk, which) == way, name)
            type_("keyup", name, letter)
            wait_for(lambda: led(desk, which) == [0, 0, 0], "its end")
        assert led(desk, 1 - which) is None
        # Arrows that led a hand lead neither the robot nor a foot when the hand is let go.
        type_("keydown", "ArrowUp", "ArrowUp")
        type_("keyup", key, code)
        wait_for(lambda: led(desk, which) is None, "letting go")
        assert last(desk)["move"] == [0, 0]
        assert page.ask("pad().move") == [0, 0]
        type_("keyup", "ArrowUp", "ArrowUp")
        type_("keydown", key, code)
        wait_for(lambda: led(desk, which) == [0, 0, 0], "the grip anew")
        page.ask("window.dispatchEvent(new Event('blur')); 0")
        wait_for(lambda: led(desk, which) is None, "letting go with the window")
        assert page.errors == []


def test_a_robot_walks_by_letters_while_arrows_lead_a_hand(plain_browser, still_front, desk):
    desk.told = desk.told | {"kind": "velocity"}
    with Page(plain_browser, still_front.drive_url) as page:
        page.wait("grips && driven()", "the hands")
        for key in ("w", "v", "ArrowLeft"):
            page.page.keyboard.down(key)
        wait_for(lambda: led(desk, 1) == [0, 1, 0], "the hand")
        assert last(desk)["move"] == [1, 0]


def test_a_key_takes_no_hand_that_is_dragged_and_without_hands_it_does_nothing(
    plain_browser, still_front, desk
):
    with Page(plain_browser, still_front.drive_url) as page:
        page.wait("grips", "the hands")
        page.ask(
            "view = {hands: () => [{position: [0, 0, 0.1], clutch: true}, {position: [0, 0, 0],"
            " clutch: false}], drags: () => [null, null], show() {}, allow() {}, release() {}}; 0"
        )
        page.page.keyboard.down("c")
        wait_for(lambda: hand(desk, 0) == [0.0, 0.0, 0.1], "the handle")
        assert page.ask("held") == [False, False]
        page.page.keyboard.up("c")
        page.ask("view = null; 0")
        desk.told = desk.told | {"hands": [], "handsDo": []}
        page.wait("!grips", "the robot without hands")
        page.page.keyboard.down("c")
        assert page.ask("held") == [False, False]


def test_a_button_holds_a_hand_for_who_presses_it_by_keys(plain_browser, still_front, desk):
    with Page(plain_browser, still_front.drive_url) as page:
        page.wait("grips", "the hands")
        for side, which in (("left", 0), ("right", 1)):
            button = page.page.get_by_role("button", name=f"Hold {side} hand", exact=True)
            assert button.count() == 1
            page.ask(f"part('hand-{side}').focus(); 0")
            page.page.keyboard.down(" ")
            page.page.keyboard.down("t")
            wait_for(lambda w=which: led(desk, w) == [0, 0, 1], "the hand")
            page.page.keyboard.up("t")
            page.page.keyboard.up(" ")
            wait_for(lambda w=which: led(desk, w) is None, "letting go")
        page.page.keyboard.press("t")
        assert "hold C or V" in page.text("said")
