"""A robot that is driven: what its keys ask for, and the page in a real browser."""

import json
import time

import numpy as np
import pytest
from operators import beat, control, gamepad, wait_for

pytest.importorskip("mujoco")
pytest.importorskip("websockets", reason="the extra teleop is not installed: no websockets")

from pages import Page

from poise.apps.live import LiveSession
from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._integrator import velocity_of
from poise.apps.live._leads import VelocityLead
from poise.apps.live._log import Takes
from poise.apps.live._loop import LiveLoop, PushOrder
from poise.locomotion import OperatorSample, VelocityLimits
from poise.locomotion._stepping import _guard as clocks

LIMITS = VelocityLimits(ahead=1.0, back=0.5, sideways=0.4, turn=0.8)


@pytest.fixture
def session(get_robot, tmp_path):
    with LiveSession(get_robot("humanoid33"), tmp_path, by="velocity") as session:
        wait_for(lambda: session.loop.snapshot or session.loop.error, "the first picture")
        assert session.loop.error is None, session.loop.error
        yield session


def asked(session):
    return session.loop.lead.leader.walker.commands.velocity


@pytest.mark.parametrize(
    ("pad", "sign"),
    [
        (OperatorSample(move=(1.0, 0.0)), (1, 0, 0)),
        (OperatorSample(move=(-1.0, 0.0)), (-1, 0, 0)),
        (OperatorSample(move=(0.0, 1.0)), (0, 1, 0)),
        (OperatorSample(turn=-1.0), (0, 0, -1)),
    ],
)
def test_sticks_ask_for_velocities_within_limits(pad, sign):
    velocity = velocity_of(pad, LIMITS)
    assert [(v > 0) - (v < 0) for v in velocity] == list(sign)
    most = (LIMITS.ahead if velocity[0] > 0 else LIMITS.back, LIMITS.sideways, LIMITS.turn)
    assert all(abs(v) <= m for v, m in zip(velocity, most, strict=True))


def test_the_right_stick_turns():
    assert gamepad(LEFTY=-1.0, RIGHTX=1.0).move == (1.0, 0.0)
    assert gamepad(RIGHTX=1.0).turn == -1.0


def test_beats_walk_the_robot_and_silence_stops_it(session):
    start = session.loop.snapshot.com[0]
    with control(session.front, session.front.seat.token) as (socket, greeting):
        assert greeting["hello"] == "operator"
        end = time.monotonic() + 60.0
        # A stick counts once it was seen at rest.
        beat(socket)
        time.sleep(0.05)
        while session.loop.snapshot.com[0] < start + 0.2:
            assert time.monotonic() < end
            beat(socket, move=[1.0, 0.0])
            time.sleep(0.03)
    wait_for(lambda: not any(asked(session)), "the rest")
    wait_for(lambda: session.loop.lead.leader.walker.lifting is None, "both feet on the ground")
    assert not session.loop.snapshot.fallen


@pytest.mark.slow
def test_the_zmp_that_is_shown_is_the_measured_one_and_its_reference_is_beside_it(session):
    seen = []
    session.inputs.take(OperatorSample())
    time.sleep(0.05)

    def walked():
        beat_once = session.loop.snapshot
        session.inputs.take(OperatorSample(move=(1.0, 0.0)))
        if not seen or beat_once.time != seen[-1].time:
            seen.append(beat_once)
        return beat_once.time > 2.5

    wait_for(walked, "two seconds of walking")
    apart = [float(np.linalg.norm(s.zmp - s.zmp_reference)) for s in seen]
    assert max(apart) > 1e-4
    assert np.median(apart) < 0.02
    assert min(s.margin for s in seen) > -0.01


def test_only_the_operator_drives(session):
    with control(session.front) as (socket, greeting):
        assert greeting["hello"] == "watcher"
        beat(socket, move=[1.0, 0.0])
        socket.send(json.dumps({"do": "reset"}))
        time.sleep(0.5)
        assert asked(session) == (0.0, 0.0, 0.0)


def test_a_reset_begins_a_new_log(session, tmp_path):
    with control(session.front, session.front.seat.token) as (socket, _):
        wait_for(lambda: session.loop.snapshot.time > 0.2, "some ticks")
        socket.send(json.dumps({"do": "reset"}))
        wait_for(lambda: session.loop.snapshot.take == "drive-002.mcap", "the second log")
    assert (tmp_path / "drive-001.mcap").exists()


def test_keys_in_a_browser_drive_the_robot(browser, session, monkeypatch):
    # Where a busy machine stops for a moment, a key that is held would have to be let go first.
    monkeypatch.setattr(clocks, "LOST_AFTER", 10.0)
    with Page(browser, session.front.drive_url) as page:
        page.wait("newest.device === 'OK'", "the operator")
        assert page.ask("[newest.kind, document.body.dataset.kind]") == ["velocity", "velocity"]
        assert page.ask("document.querySelector('details').offsetHeight") == 0
        keyboard = page.page.keyboard
        keyboard.down("w")
        wait_for(lambda: asked(session)[0] > 0.0, "the command")
        wait_for(lambda: session.loop.lead.leader.walker.lifting is not None, "a step")
        keyboard.up("w")
        keyboard.down("q")
        wait_for(lambda: asked(session)[2] > 0.0, "the turn")
        keyboard.up("q")
        # A gamepad of the browser's: what the page would see of one.
        page.ask(
            "navigator.getGamepads = () => [{connected: true, mapping: 'standard', buttons: [],"
            " axes: [0, 0.9, 0, 0]}]; 0"
        )
        wait_for(lambda: asked(session)[0] < 0.0, "the gamepad")
        page.wait("part('mode-text').textContent.includes('m/s')", "the speed in words")
        assert page.errors == []


def test_a_push_is_as_the_robot_faces(get_robot, tmp_path, monkeypatch):
    """Its buttons say ahead, back, left and right, also when it has turned."""
    import mujoco

    lead = VelocityLead(get_robot("biped20"), OperatorInputs())
    loop = LiveLoop(lead, Takes(tmp_path))
    loop._tick()
    half = 0.5 * 2.2
    loop.plant.data.qpos[3:7] = np.cos(half), 0.0, 0.0, np.sin(half)
    mujoco.mj_kinematics(loop.plant.model, loop.plant.data)
    given = []
    monkeypatch.setattr(loop.plant, "push", lambda body, force, time: given.append(force))
    loop.order(PushOrder("left"))
    loop._carry_out()
    loop.stop()
    x, y, z = given[0]
    assert np.arctan2(y, x) == pytest.approx(2.2 + np.pi / 2 - 2 * np.pi)
    assert np.hypot(x, y) == pytest.approx(loop.lead.robot.mass * 0.8)
    assert z == 0.0
