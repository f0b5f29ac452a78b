"""The page in a real browser, as an operator and as a watcher."""

import contextlib
import math
import re
import time

import numpy as np
import pytest
from operators import PATIENCE, comes, listen_to, same_commands, wait_for

pytest.importorskip("websockets", reason="the extra teleop is not installed: no websockets")

from pages import Page

from poise.apps.live._loop import Pause
from poise.apps.teleoperation import MODES, TORQUE_TELEOP_PLANT, read_recording, replay_teleop
from poise.locomotion import DeviceStatus, HandStatus, Mode

UP_THE_ARROW = 0.12
"""From the middle of a handle to a point of its upper arrow [m]."""
MODES_OF_A_STEP = {MODES.index(mode) for mode in (Mode.D, Mode.TR, Mode.SR)}


@pytest.fixture
def session(run_session, tmp_path):
    with run_session(tmp_path / "takes") as session:
        wait_for(lambda: session.loop.snapshot or session.loop.error, "the first picture")
        assert session.loop.error is None, session.loop.error
        yield session


@pytest.fixture(scope="module")
def _shared(run_session, tmp_path_factory):
    with run_session(tmp_path_factory.mktemp("takes")) as session:
        wait_for(lambda: session.loop.snapshot or session.loop.error, "the first picture")
        yield session


@pytest.fixture
def standing(_shared):
    """A session for tests in which the robot stands, with nobody in the seat; else it pauses."""
    _shared.loop.order(Pause(False))
    wait_for(lambda: not _shared.front.seat.taken, "an empty seat")
    wait_for(lambda: _shared.loop.snapshot.device is DeviceStatus.LOST, "the guard")
    yield _shared
    _shared.loop.order(Pause(True))


def lift(page, begin, let_go, lifted):
    """Lift a foot until `lifted` holds; let go and begin anew where the page lost touch."""
    end = time.monotonic() + 2.0 * PATIENCE
    while time.monotonic() < end:
        begin()
        if comes(lifted, 20.0):
            return
        let_go()
        page.wait("newest.mode === 'D' && newest.device !== 'LOST'", "the start")
    raise AssertionError("waited in vain for the lift")


def hold(page, key, lifted, again="0"):
    """Hold a key until a foot is up."""

    def begin():
        page.ask(f"{again}; 0")
        page.page.keyboard.down(key)

    lift(page, begin, lambda: page.page.keyboard.up(key), lambda: page.ask(lifted))


def on_screen(page, which, above, of="handles"):
    """Where a point above a handle, of feet or hands, [m] is drawn, in pixels of the page."""
    return page.ask(
        f"""(() => {{
          const box = part("view").getBoundingClientRect();
          const point = view.{of}[{which}].object.position.clone();
          point.z += {above};
          point.project(view.stage.camera);
          return [box.left + 0.5 * box.width * (1 + point.x),
                  box.top + 0.5 * box.height * (1 - point.y)];
        }})()"""
    )


def at_rest(place):
    """A place on the screen, once camera and robot have come to rest."""
    seen = []

    def rests():
        time.sleep(0.1)
        seen.append(place())
        return len(seen) > 1 and np.abs(np.subtract(*seen[-2:])).max() < 0.5

    wait_for(rests, "the camera to come to rest")
    return seen[-1]


def hover(page):
    """Move the mouse onto the upper arrow of the left foot's handle; return the place.

    The page looks for an arrow only while the mouse moves and a device drives.
    """
    seen = []

    def found():
        seen.append(at_rest(lambda: on_screen(page, 0, UP_THE_ARROW)))
        page.page.mouse.move(*seen[-1])
        return comes(lambda: page.ask("view.handles[0].axis !== null"), 0.5)

    wait_for(found, "the arrow to be found under the mouse")
    return seen[-1]


def test_a_handle_is_drawn_only_where_the_pointer_is_or_what_is_held(browser, standing):
    drawn = "[...view.handles, ...view.grips].map((handle) => handle.getHelper().visible)"
    with Page(browser, standing.front.drive_url) as page:
        page.wait("view !== null && newest.device !== 'LOST'", "the device")
        assert page.ask(drawn) == [False] * 4
        hover(page)
        assert page.ask(drawn) == [True, False, False, False]
        page.page.mouse.move(5, 5)
        page.wait(f"{drawn}.every((shown) => !shown)", "the handle to go")
        page.ask("held[1] = true; 0")
        page.wait(f"{drawn}.join() === 'false,false,false,true'", "the handle of the hand")


def drag_a_hand_up(page, loop, height):
    """Drags the left hand's handle up by 15 cm until the hand is at a height [m].

    Where a busy machine loses the page while it drags one lets go, and takes hold anew; a hand that
    is led and does not come has failed.
    """
    mouse = page.page.mouse
    begin = time.monotonic()
    while time.monotonic() < begin + PATIENCE:
        x, y = on_screen(page, 0, UP_THE_ARROW, "grips")
        _, top = on_screen(page, 0, UP_THE_ARROW + 0.15, "grips")
        mouse.move(x, y)
        time.sleep(0.5)
        mouse.down()
        page.wait("view.hands()[0].clutch", "the grip")
        for step in range(1, 7):
            mouse.move(x, y + step / 6 * (top - y))
            time.sleep(0.1)
        wait_for(
            lambda: (
                loop.snapshot.hands[0][2] > height
                or loop.snapshot.hands_do[0] is not HandStatus.LED
            ),
            "the hand",
        )
        if loop.snapshot.hands[0][2] > height:
            return
        mouse.up()
        page.wait("!view.hands()[0].clutch", "the grip to open")
    raise AssertionError("waited in vain for the hand")


def test_a_dragged_handle_lifts_the_foot_letting_go_lowers_it_and_a_replay_is_the_same(
    browser, session, tmp_path
):
    heard = listen_to(session.loop)
    with Page(browser, session.front.drive_url) as page:
        assert page.text("role") == "you drive"
        page.wait("view !== null", "the drawing")
        page.wait("newest.device !== 'LOST'", "the device")
        mouse = page.page.mouse

        def drag():
            x, y = hover(page)
            _, top = on_screen(page, 0, UP_THE_ARROW + 0.12)
            mouse.down()
            for step in range(1, 7):
                mouse.move(x, y + step / 6 * (top - y))

        lift(page, drag, mouse.up, lambda: session.loop.snapshot.soles[0][2] > 0.04)
        assert session.loop.snapshot.mode is Mode.SR
        page.wait("newest.mode === 'SR'", "the page to show it")
        mouse.up()
        page.wait("newest.mode === 'D'", "double support")
        assert page.errors == []
        assert not session.loop.snapshot.fallen
    session.loop.stop()
    run = replay_teleop(read_recording(tmp_path / "takes" / "take-001.mcap"))
    assert set(run.log.mode.tolist()) >= MODES_OF_A_STEP
    assert same_commands(run, heard)


@pytest.mark.slow
def test_a_hands_handle_is_dragged_the_hand_stays_and_goes_back_to_rest(
    browser, run_session, tmp_path
):
    with run_session(tmp_path / "takes", plant=TORQUE_TELEOP_PLANT) as session:
        wait_for(lambda: session.loop.snapshot or session.loop.error, "the first picture")
        with Page(browser, session.front.drive_url) as page:
            page.wait("view !== null && newest.device !== 'LOST'", "the device")
            assert not page.ask("view.grips.some((grip) => grip.enabled)")
            assert page.ask("part('hands-row').offsetHeight > 0")
            time.sleep(1.0)
            home = session.loop.snapshot.hands[0][2]
            drag_a_hand_up(page, session.loop, home + 0.08)
            mouse = page.page.mouse
            assert session.loop.snapshot.hands_do[0] is HandStatus.LED
            mouse.up()
            page.wait("part('hands').textContent === 'left held'", "the page to show it")
            press(page, "rest", lambda: session.loop.snapshot.hands_do[0] is HandStatus.REST)
            mouse.up()
            page.wait("part('hands').textContent === 'at rest'", "the page to show it")
            assert page.errors == []
            assert session.loop.snapshot.mode is Mode.D
            assert not session.loop.snapshot.fallen


def test_a_key_steps_the_plots_grow_and_the_hint_goes(browser, session):
    with Page(browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        assert not page.ask("part('hint').hidden")
        hold(page, "e", "newest.mode === 'SL'")
        page.page.keyboard.up("e")
        page.wait("newest.mode === 'D'", "double support")
        page.wait("part('hint').hidden", "the hint to go")
        assert page.ask("past.length") > 10
        assert page.text("margin").endswith(" cm")
        assert page.text("latency").endswith(" ms")
        assert page.errors == []


@pytest.mark.slow
def test_a_gamepad_shakes_when_a_foot_lands_and_not_before(browser, session):
    with Page(browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        page.ask(
            "window.shaken = [];"
            "navigator.getGamepads = () => [{connected: true, mapping: 'standard', buttons: [],"
            " axes: [], vibrationActuator: {playEffect: (kind) => shaken.push(kind)}}]; 0"
        )
        hold(page, "e", "newest.mode === 'SL' && newest.soles[1][2] > 0.04", "shaken.length = 0")
        assert page.ask("shaken") == []
        page.page.keyboard.up("e")
        page.wait("newest.mode === 'D'", "double support")
        page.wait("shaken.length > 0", "the shaking")
        assert page.ask("shaken") == ["dual-rumble"]
        assert page.errors == []


@pytest.mark.slow
def test_a_closed_page_in_mid_step_brings_the_foot_down(browser, session):
    with Page(browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        hold(page, "e", "newest.soles[1][2] > 0.05")
    with Page(browser, session.front.watch_url) as watcher:
        wait_for(lambda: session.loop.snapshot.device is DeviceStatus.LOST, "the loss")
        watcher.wait("part('device').textContent === 'nobody drives'", "the page to show it")
        wait_for(lambda: session.loop.snapshot.mode is Mode.D, "both feet on the ground")
        assert not session.loop.snapshot.fallen


def test_without_the_token_one_sees_but_cannot_command(browser, standing):
    with Page(browser, standing.front.watch_url) as page:
        assert page.text("role") == "you watch"
        assert page.ask("part('controls').disabled")
        page.wait("newest.mode === 'D'", "the mode")
        page.wait("view !== null && view.stage.groups[1].position.z > 0", "the drawing")
        assert not page.ask("[...view.handles, ...view.grips].some((handle) => handle.enabled)")
        page.page.keyboard.down("e")
        # What the page would send if somebody took its locks off.
        page.ask("driving = true; beat(); send({do: 'pause', value: true}); 0")
        page.wait("part('said').textContent.includes('watching')", "the refusal")
        time.sleep(0.5)
        now = standing.loop.snapshot
        assert (now.mode, now.paused) == (Mode.D, False)
        assert now.device is DeviceStatus.LOST


def test_buttons_push_pause_and_keep(browser, session):
    with Page(browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        click = "document.querySelector('{}').click()"
        page.ask(click.format('[data-push="left"]'))
        wait_for(lambda: abs(session.loop.snapshot.zmp[1]) > 0.005, "the push to be felt")
        page.ask(click.format("#keep"))
        page.wait("part('said').textContent.includes('kept-001.mcap')", "the copy")
        page.ask(click.format("#pause"))
        wait_for(lambda: session.loop.snapshot.paused, "the pause")


def test_a_wrong_token_is_said(browser, standing):
    with Page(browser, standing.front.watch_url + "?token=wrong") as page:
        page.wait("part('banner').textContent.includes('wrong')", "the message")
        assert page.text("role") == "you watch"


HEAR = """
  window.sent = [];
  const real = send;
  send = (message) => { if (message.do === "drive") sent.push(message); real(message); };
  0
"""
"""From now on what the page says is known."""

LISTEN = "clearInterval(beating);" + HEAR
"""From now on the page says nothing by its clock, and what it says otherwise is known."""


@pytest.mark.slow
def test_keys_and_buttons_do_not_wait_for_the_next_beat(browser, session):
    with Page(browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        page.ask("clearInterval(looking);" + LISTEN)
        key = "window.dispatchEvent(new KeyboardEvent('{}', {{key: 'e'}})); sent.map((m) => m.lift)"
        assert page.ask(key.format("keydown")) == [[False, True]]
        assert page.ask(key.format("keyup")) == [[False, True], [False, False]]
        press(page, "lift-left", lambda: page.ask("sent.length === 3"))
        page.page.mouse.up()
        page.wait("sent.length === 4", "its release")
        assert page.ask("sent.map((m) => m.lift[0])") == [False, False, True, False]
        assert page.errors == []


def test_handles_and_gamepads_do_not_wait_for_the_next_beat(browser, session):
    with Page(browser, session.front.drive_url) as page:
        page.wait("view !== null && newest.device !== 'LOST'", "the device")
        page.ask(LISTEN)
        page.ask("view.drags = () => [null, [0, -0.1, 0.05]]; 0")
        page.wait("sent.some((m) => m.feet[1] !== null)", "the handle")
        page.ask(
            "navigator.getGamepads = () => [{connected: true, mapping: 'standard', axes: [],"
            " buttons: [0, 0, 0, 0, 1].map((on) => ({pressed: Boolean(on)}))}]; 0"
        )
        page.wait("sent.some((m) => m.lift[0])", "the gamepad")
        assert page.errors == []


def asked(session):
    """What was received last of the body."""
    return session.status()["asked"]


NEUTRAL = {"height": 0.0, "torso": (0.0, 0.0, 0.0), "turns": (0.0, 0.0)}


@pytest.mark.slow
def test_keys_and_a_gamepad_bend_the_body_until_it_is_set_straight(browser, run_session, tmp_path):
    with run_session(tmp_path / "takes", plant=TORQUE_TELEOP_PLANT) as session:
        wait_for(lambda: session.loop.snapshot or session.loop.error, "the first picture")
        with Page(browser, session.front.drive_url) as page:
            page.wait("newest.device !== 'LOST'", "the device")
            keyboard = page.page.keyboard
            page.ask(HEAR)
            keyboard.press("ArrowUp")
            assert not page.ask("sent.some((message) => message.body || message.bend)")
            for key, bent in (
                ("f", lambda body: body["height"] < -0.01),
                ("k", lambda body: body["torso"][1] < -0.05),
                ("j", lambda body: body["torso"][2] > 0.05),
                ("h", lambda body: body["torso"][0] > 0.05),
            ):
                keyboard.down(key)
                wait_for(lambda bent=bent: bent(asked(session)), key)
                keyboard.up(key)
            keyboard.press("o")
            assert "held" in page.text("said")
            keyboard.down("e")
            keyboard.down("o")
            wait_for(lambda: asked(session)["turns"][1] < -0.05, "the turn")
            keyboard.up("o")
            keyboard.up("e")
            stays = asked(session)
            page.wait("part('body-now').textContent.includes('right foot')", "the words")
            assert "right" in page.text("bent-roll")
            assert asked(session) == stays
            page.ask(
                "navigator.getGamepads = () => [{connected: true, mapping: 'standard', axes: [],"
                " buttons: [...Array(16).keys()].map((i) => ({pressed: i === 1 || i === 12}))}]; 0"
            )
            wait_for(lambda: asked(session)["torso"][1] == 0.4, "the gamepad")
            page.ask("navigator.getGamepads = () => []; 0")
            keyboard.press("n")
            wait_for(lambda: asked(session) == NEUTRAL, "the key for neutral")
            assert not page.ask("sent.at(-1).body || sent.at(-1).bend")
            assert page.errors == []


@pytest.mark.slow
def test_a_slider_lowers_the_body_and_only_that_where_velocities_are_commanded(browser, session):
    with Page(browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        page.ask("document.querySelector('summary').click()")
        assert page.ask("part('bend-height').offsetHeight > 0")
        assert page.ask("part('bend-yaw').offsetHeight === 0")
        page.ask(
            "part('bend-height').value = -0.05;"
            "part('bend-height').dispatchEvent(new Event('input')); 0"
        )
        wait_for(lambda: asked(session)["height"] == -0.05, "the slider")
        high = session.loop.snapshot.com[2]
        wait_for(lambda: session.loop.snapshot.com[2] < high - 0.02, "the robot to come down")
        page.wait("part('body-now').textContent === '−5 cm'", "the words")
        page.page.keyboard.press("j")
        assert "only the height" in page.text("said")
        with Page(browser, session.front.watch_url) as watcher:
            watcher.wait("part('bent-height').textContent === '−5 cm'", "the watcher's page")
            assert watcher.ask("part('bends').disabled")
        page.ask("part('neutral').click()")
        wait_for(lambda: asked(session) == NEUTRAL, "the way back")
        assert page.errors == []


def press(page, name, done):
    """Presses the mouse on a part of the page, until that has done something.

    Lines above it come and go with what robot and device do: it may move away under the mouse.
    """
    script = """((part) => {
        part.scrollIntoView({block: 'center'});
        const {left, top, width, height} = part.getBoundingClientRect();
        return [left + width / 2, top + height / 2];
    })"""
    end = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < end, f"pressed {name} in vain"
        page.page.mouse.up()
        page.page.mouse.move(*page.ask(f"{script}(part('{name}'))"))
        page.page.mouse.down()
        with contextlib.suppress(AssertionError):
            wait_for(done, name, patience=3.0)


def middle(page, name):
    """The middle of a part of the page, in pixels."""
    left, top, width, height = box(page, name)
    return left + width / 2, top + height / 2


def box(page, name):
    """Left, top, width and height of a part of the page, in pixels."""
    return page.ask(
        f"(({{left, top, width, height}}) => [left, top, width, height])"
        f"(part('{name}').getBoundingClientRect())"
    )


@pytest.mark.slow
def test_the_help_can_be_called_back_and_then_stays(browser, session):
    with Page(browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        hidden = "part('help').hidden"
        assert page.ask(hidden)
        page.ask("part('help-open').click()")
        assert not page.ask(hidden)
        page.page.keyboard.down("e")
        page.wait("newest.mode === 'SL'", "the lift")
        page.page.keyboard.up("e")
        page.wait("newest.mode === 'D'", "double support")
        assert not page.ask(hidden)
        page.ask("part('help-close').click()")
        assert page.ask(hidden)


@pytest.mark.slow
def test_a_hint_goes_by_itself(browser, session):
    with Page(browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        page.page.keyboard.press("ArrowUp")
        assert "hold Q or E" in page.text("said")
        page.wait("part('said').textContent.trim() === ''", "the hint to go")


@pytest.mark.slow
def test_on_a_phone_the_robot_has_the_upper_half_and_can_be_led(browser, session):
    width, height = 390, 844
    phone = {
        "viewport": {"width": width, "height": height},
        "is_mobile": True,
        "has_touch": True,
    }
    with Page(browser, session.front.drive_url, **phone) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        left, top, wide, high = box(page, "view")
        assert (left, top, wide) == (0, 0, width)
        assert high > 0.5 * height
        assert box(page, "hint")[1] >= high
        for name in ("lift-left", "lift-right"):
            _, top, wide, tall = box(page, name)
            assert high <= top < height - tall
            assert min(wide, tall) >= 40
            assert top + tall <= box(page, "hint")[1]
        assert page.ask("document.querySelector('[data-arrow=ArrowUp]').offsetHeight") >= 40
        x, y = middle(page, "lift-right")
        touch = page.page.context.new_cdp_session(page.page)
        touch.send(
            "Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]}
        )
        wait_for(lambda: session.loop.snapshot.mode is Mode.SL, "the lift")
        touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        wait_for(lambda: session.loop.snapshot.mode is Mode.D, "double support")
        assert page.errors == []


def test_who_has_read_the_page_alone_makes_a_step_within_a_minute(browser, session):
    begin = time.monotonic()
    with Page(browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        told = page.ask("part('hint').innerText")
        key = re.search(r"Hold (\w), then", " ".join(told.split()))[1]
        first = session.loop.snapshot.soles[0][0]
        assert "arrow keys" in told

        def moved():
            return session.loop.snapshot.soles[0][0] > first + 0.05

        while not moved() and time.monotonic() - begin < 60.0:
            # Where a busy machine loses the page meanwhile one lets go, and begins again.
            page.page.keyboard.up(key.lower())
            page.page.keyboard.down(key.lower())
            if not comes(lambda: session.loop.snapshot.mode is Mode.SR, 5.0):
                continue
            page.page.keyboard.down("ArrowUp")
            wait_for(lambda: moved() or session.loop.snapshot.mode is Mode.D, "the way, or a loss")
            page.page.keyboard.up("ArrowUp")
        page.page.keyboard.up(key.lower())
        wait_for(lambda: session.loop.snapshot.mode is Mode.D, "the landing")
    assert time.monotonic() - begin < 60.0
    assert not session.loop.snapshot.fallen


@pytest.mark.slow
def test_a_tab_that_sleeps_in_mid_step_lands_and_leads_only_after_letting_go(browser, session):
    with Page(browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        page.page.keyboard.down("e")
        wait_for(lambda: session.loop.snapshot.soles[1][2] > 0.04, "the lift")
        page.ask(
            "setTimeout(() => { const end = performance.now() + 3000;"
            " while (performance.now() < end); }); 0"
        )
        wait_for(lambda: session.loop.snapshot.device is DeviceStatus.LOST, "the loss")
        wait_for(lambda: session.loop.snapshot.mode is Mode.D, "both feet on the ground")
        wait_for(lambda: session.loop.snapshot.device is not DeviceStatus.LOST, "its waking")
        now = session.loop.snapshot.time
        wait_for(lambda: session.loop.snapshot.time > now + 1.0, "a second")
        # The key was never let go, and says nothing any more.
        assert session.loop.snapshot.mode is Mode.D
        page.page.keyboard.up("e")
        time.sleep(0.2)
        page.page.keyboard.down("e")
        wait_for(lambda: session.loop.snapshot.mode is Mode.SL, "the lift anew")
        page.page.keyboard.up("e")
        wait_for(lambda: session.loop.snapshot.mode is Mode.D, "double support")
        assert not session.loop.snapshot.fallen


HIDE = """
  Object.defineProperty(document, "hidden", {{configurable: true, get: () => {hidden}}});
  document.dispatchEvent(new Event("visibilitychange"));
  0
"""


@pytest.mark.slow
def test_a_tab_that_is_hidden_in_mid_step_lands_and_drives_again_when_it_is_seen(
    plain_browser, session
):
    with Page(plain_browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        hold(page, "e", "newest.soles[1][2] > 0.04")
        page.ask(HIDE.format(hidden="true"))
        wait_for(lambda: session.loop.snapshot.device is DeviceStatus.LOST, "the loss")
        wait_for(lambda: session.loop.snapshot.mode is Mode.D, "both feet on the ground")
        # Longer than it takes for somebody else to be let in.
        wait_for(lambda: not session.front.seat.taken, "the silence")
        page.ask(HIDE.format(hidden="false"))
        wait_for(lambda: session.loop.snapshot.device is not DeviceStatus.LOST, "its waking")
        assert page.text("role") == "you drive"
        assert page.ask("pad().lift") == [False, False]
        page.page.keyboard.up("e")
        hold(page, "e", "newest.mode === 'SL'")
        page.page.keyboard.up("e")
        wait_for(lambda: session.loop.snapshot.mode is Mode.D, "double support")
        assert not session.loop.snapshot.fallen


@pytest.mark.slow
def test_a_gamepad_that_holds_both_feet_lifts_one_and_the_robot_stands(plain_browser, session):
    with Page(plain_browser, session.front.drive_url) as page:
        page.wait("newest.device !== 'LOST'", "the device")
        page.ask(
            "window.axes = [-0.5, -1, 0.5, -1]; window.down = true;"
            "navigator.getGamepads = () => [{connected: true, mapping: 'standard', axes,"
            " buttons: [0, 0, 0, 0, 1, 1].map((on) => ({pressed: Boolean(on && down)}))}]; 0"
        )
        wait_for(lambda: session.loop.snapshot.mode in (Mode.SL, Mode.SR), "the lift")
        lifted = 0 if session.loop.snapshot.mode is Mode.SR else 1
        first = session.loop.snapshot.soles[lifted][0]
        wait_for(lambda: session.loop.snapshot.soles[lifted][0] > first + 0.05, "its way")
        assert session.loop.snapshot.soles[1 - lifted][2] < 0.01
        page.ask("down = false; axes.fill(0); 0")
        wait_for(lambda: session.loop.snapshot.mode is Mode.D, "double support")
        assert not session.loop.snapshot.fallen
        assert page.errors == []


def test_the_view_goes_along_and_stays_behind_the_robot(browser, standing):
    with Page(browser, standing.front.drive_url) as page:

        def seen(x, y, heading):
            """Where the camera is and what it looks at, as the robot faces from where it is."""
            return page.ask(
                f"""(() => {{
                  const s = structuredClone(newest);
                  s.com[0] = {x}; s.com[1] = {y}; s.heading = {heading};
                  view.show(s);
                  const from = (p) => [p.x - {x}, p.y - {y}];
                  return [from(view.stage.camera.position), from(view.stage.controls.target)];
                }})()"""
            )

        (behind, left), (ahead, _) = seen(0.0, 0.0, 0.0)
        assert behind < -1.0
        # Who only shifts the weight moves nothing.
        assert seen(0.1, 0.1, 0.2)[0] == pytest.approx([behind - 0.1, left - 0.1], abs=1e-6)
        camera, target = seen(30.0, -5.0, 0.0)
        assert camera == pytest.approx([behind, left], abs=0.3)
        assert target == pytest.approx([ahead, 0.0], abs=0.3)
        camera, _ = seen(30.0, -5.0, 3.0)
        assert camera[0] > 1.0
        page.ask("view.handles[0].dragging = true; 0")
        before = page.ask("view.stage.camera.position.x")
        seen(0.0, 0.0, 0.0)
        assert page.ask("view.stage.camera.position.x") == before


def test_a_key_that_walks_moves_no_slider(browser, standing):
    with Page(browser, standing.front.drive_url) as page:
        slider = "document.querySelector('input[type=range]')"
        page.ask(f"{slider}.focus(); 0")
        before = page.ask(f"{slider}.value")
        for _ in range(6):
            page.page.keyboard.down("ArrowDown")
        page.page.keyboard.up("ArrowDown")
        assert page.ask(f"{slider}.value") == before
        assert page.ask("keys.arrows.size") == 0


def test_a_hands_handle_that_is_dragged_to_the_horizon_lets_go_of_nothing_else(browser, standing):
    with Page(browser, standing.front.drive_url) as page:
        page.wait("view !== null && newest.device !== 'LOST'", "the device")
        page.ask("keys.left = view.grips[1].dragging = true; 0")
        page.ask("view.grips[1].object.position.set(-3e5, 2e4, 0.5); 0")
        x, y, _ = page.ask("view.hands()[1].position")
        assert math.hypot(x, y) > 1e5
        wait_for(lambda: (pad := standing.inputs.read()) and pad.lift[0], "the key")
        assert page.text("said").strip() == ""
        assert page.errors == []


def test_a_gamepad_of_no_known_layout_leads_nothing_and_that_is_said(browser, standing):
    with Page(browser, standing.front.drive_url) as page:
        page.ask(
            "navigator.getGamepads = () => [{connected: true, mapping: '', axes: [0, 0, -1, 0],"
            " buttons: [{pressed: true}]}]; 0"
        )
        page.wait(
            "document.body.textContent.includes('does not know where that gamepad')", "a hint"
        )
        assert page.ask("[pad().turn, pad().second, pad().upright]") == [0, [0, 0], False]
