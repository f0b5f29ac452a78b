"""A robot that is driven by velocities."""

import numpy as np
import pytest
from operators import beat, control, wait_for

pytest.importorskip("mujoco")
pytest.importorskip("websockets", reason="the extra teleop is not installed: no websockets")

from poise.apps.live import LiveSession
from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._integrator import velocity_of
from poise.apps.live._leads import VelocityLead
from poise.apps.live._log import Takes
from poise.apps.live._loop import LiveLoop, PushOrder, Reset
from poise.locomotion import OperatorSample, VelocityLimits


@pytest.fixture
def session(get_robot, tmp_path):
    with LiveSession(get_robot("humanoid33"), tmp_path, by="velocity") as session:
        wait_for(lambda: session.loop.snapshot or session.loop.error, "the first picture")
        assert session.loop.error is None, session.loop.error
        yield session


def asked(session):
    return session.loop.lead.leader.walker.commands.velocity


def test_sticks_ask_for_velocities_within_limits_and_rest_near_the_middle():
    limits = VelocityLimits(ahead=1.0, back=0.5, sideways=0.4, turn=0.8)
    for pad, velocity in (
        (OperatorSample(move=(1.0, 0.0)), (0.85, 0.0, 0.0)),
        (OperatorSample(move=(-1.0, 0.0)), (-0.425, 0.0, 0.0)),
        (OperatorSample(move=(0.0, 1.0)), (0.0, 0.34, 0.0)),
        (OperatorSample(turn=-1.0), (0.0, 0.0, -0.68)),
        (OperatorSample(move=(0.04, -0.05), turn=0.03), (0.0, 0.0, 0.0)),
        (OperatorSample(move=(0.06, 0.0)), (0.051, 0.0, 0.0)),
    ):
        assert velocity_of(pad, limits) == pytest.approx(velocity)


def test_beats_walk_the_robot_silence_stops_it_and_a_reset_begins_a_new_log(session, tmp_path):
    start, seen = session.loop.snapshot.com[0], []
    with control(session.front, session.front.seat.token) as (socket, greeting):
        assert greeting["hello"] == "operator"
        # A stick counts once it was seen at rest.
        beat(socket)

        def walked():
            beat(socket, move=[1.0, 0.0])
            seen.append(session.loop.snapshot)
            return seen[-1].com[0] > start + 0.2

        wait_for(walked, "the walk")
    wait_for(lambda: not any(asked(session)), "the rest")
    wait_for(lambda: session.loop.lead.leader.walker.lifting is None, "both feet on the ground")
    assert not session.loop.snapshot.fallen
    # The ZMP that is shown is the measured one, with its reference beside it.
    apart = [float(np.linalg.norm(s.zmp - s.zmp_reference)) for s in seen]
    assert max(apart) > 1e-4
    assert np.median(apart) < 0.02
    assert min(s.margin for s in seen) > -0.01
    session.loop.order(Reset())
    wait_for(lambda: session.loop.snapshot.take == "drive-002.mcap", "the second log")
    assert (tmp_path / "drive-001.mcap").exists()


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
