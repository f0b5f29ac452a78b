"""Hands that are led by keys, in a real browser with a robot behind it that stands still."""

import pytest

pytest.importorskip("websockets", reason="the extra teleop is not installed: no websockets")

from operators import wait_for
from pages import Page


def last(desk):
    """What the page said last."""
    return desk.orders[-1] if desk.orders else {"hands": [None, None]}


def hand(desk, which):
    """Where a hand has been led to since it was taken hold of [m]; None while it is not led."""
    said = last(desk)["hands"][which]
    return said["position"] if said and said["clutch"] else None


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
        assert hand(desk, which) is None
        assert type_("keydown", key, code)
        wait_for(lambda: hand(desk, which) == [0.0, 0.0, 0.0], "the grip")
        for name, letter, axis, sign in (
            ("ArrowUp", "ArrowUp", 0, 1), ("ArrowDown", "ArrowDown", 0, -1),
            ("ArrowLeft", "ArrowLeft", 1, 1), ("ArrowRight", "ArrowRight", 1, -1),
            ("t", "KeyT", 2, 1), ("b", "KeyB", 2, -1),
        ):  # fmt: skip
            before = page.ask(f"[...moved[{which}]]")
            assert type_("keydown", name, letter)
            wait_for(
                lambda b=before, a=axis, s=sign: s * (hand(desk, which)[a] - b[a]) > 0.02, name
            )
            type_("keyup", name, letter)
            assert [v for a, v in enumerate(page.ask(f"moved[{which}]")) if a != axis] == [
                v for a, v in enumerate(before) if a != axis
            ]
        assert hand(desk, 1 - which) is None
        # Arrows that led a hand lead neither the robot nor a foot when the hand is let go.
        type_("keydown", "ArrowUp", "ArrowUp")
        type_("keyup", key, code)
        wait_for(lambda: hand(desk, which) is None, "letting go")
        assert last(desk)["move"] == [0, 0]
        assert page.ask("pad().move") == [0, 0]
        type_("keyup", "ArrowUp", "ArrowUp")
        # Taken hold of anew, it begins where it is.
        type_("keydown", key, code)
        wait_for(lambda: hand(desk, which) == [0.0, 0.0, 0.0], "the grip anew")
        page.ask("window.dispatchEvent(new Event('blur')); 0")
        wait_for(lambda: hand(desk, which) is None, "letting go with the window")
        assert page.errors == []


def test_a_robot_walks_by_letters_while_arrows_lead_a_hand(plain_browser, still_front, desk):
    desk.told = desk.told | {"kind": "velocity"}
    with Page(plain_browser, still_front.drive_url) as page:
        page.wait("grips && driven()", "the hands")
        for key in ("w", "v", "ArrowLeft"):
            page.page.keyboard.down(key)
        wait_for(lambda: hand(desk, 1) and hand(desk, 1)[1] > 0.02, "the hand")
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
            wait_for(lambda w=which: hand(desk, w) and hand(desk, w)[2] > 0.02, "the hand")
            page.page.keyboard.up("t")
            page.page.keyboard.up(" ")
            wait_for(lambda w=which: hand(desk, w) is None, "letting go")
        page.page.keyboard.press("t")
        assert "hold C or V" in page.text("said")
