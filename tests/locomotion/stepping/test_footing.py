"""What follows from a tick's state and mode: the ZMP's reference, support, and the COM's height."""

from dataclasses import replace

import numpy as np
import pytest
from standing import PARAMETERS, foot_range, footing, numbers

from poise.dynamics import RobotState
from poise.locomotion import Mode, StepTeleoperator
from poise.locomotion._stepping._velocity_level import ComHeight
from poise.locomotion._support import SolePart
from poise.locomotion._walking._legs import FootRange

AWAY = (3.0, -2.0)


def com_height(robot, height, **changes):
    parameters = replace(PARAMETERS, **changes)
    reach = foot_range(robot, parameters)
    return ComHeight(height, reach, parameters, numbers(robot))


@pytest.mark.parametrize(("mode", "foot"), [(Mode.TL, 0), (Mode.SL, 0), (Mode.TR, 1), (Mode.SR, 1)])
def test_the_zmp_goes_to_the_place_of_the_foot_that_shall_carry(get_robot, mode, foot):
    now = footing(get_robot("biped20"), mode, at=AWAY)
    np.testing.assert_array_equal(now.zmp_reference, now.anchors[foot][:2])


def test_on_two_feet_the_zmp_goes_to_their_middle(get_robot):
    now = footing(get_robot("biped20"), Mode.D, at=AWAY)
    np.testing.assert_allclose(now.zmp_reference, AWAY, atol=0.1)
    np.testing.assert_allclose(now.sole(0)[:2] + now.sole(1)[:2] - 2.0 * now.zmp_reference, 0.0)


@pytest.mark.parametrize(("mode", "inside"), [(Mode.D, [True, True]), (Mode.SL, [True, False])])
def test_soles_on_the_ground_support_and_others_do_not(get_robot, mode, inside):
    now = footing(get_robot("biped20"), mode, at=AWAY)
    depths = [now.support.depth(tuple(now.sole(foot)[:2].tolist())) for foot in (0, 1)]
    assert [depth > 0.0 for depth in depths] == inside


def test_two_feet_support_on_what_carries_of_them(get_robot):
    whole = footing(get_robot("biped20"), Mode.D, at=AWAY)
    # Of the left sole the last 4 cm are on something.
    heel = SolePart(-0.5 * whole.biped.sizes[0][0] + 0.02, 0.0, 0.04, 0.2)
    part = replace(whole, parts=(heel, None))
    toes = tuple((whole.sole(0)[:2] + (0.08, 0.0)).tolist())
    assert whole.support.depth(toes) > 0.0 > part.support.depth(toes)
    behind = tuple((whole.sole(0)[:2] - (0.12, 0.0)).tolist())
    assert part.support.depth(behind) > 0.0
    single = footing(get_robot("biped20"), Mode.SL, at=AWAY)
    assert replace(single, parts=(heel, None)).support.depth(toes) > 0.0


def test_a_torso_that_is_turned_on_its_waist_turns_no_heading(get_robot):
    robot = get_robot("g1")
    teleoperator = StepTeleoperator(robot, actuation="torque")
    q, waist = robot.q_home.copy(), ("waist_yaw_joint", "waist_pitch_joint")
    q[robot.nq - robot.nj + np.array([robot.joint_index(name) for name in waist])] = 1.0, 0.4
    teleoperator.estimator.dynamics.update(RobotState(q, np.zeros(robot.nv)))
    now = teleoperator._level._footing()
    np.testing.assert_allclose(now.heading, (1.0, 0.0), atol=1e-9)
    assert now.tilt == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize("actuation", ["torque", "velocity"])
def test_a_status_that_is_read_late_is_of_its_tick(get_robot, actuation):
    robot = get_robot("biped20")
    soon, late = (StepTeleoperator(robot, actuation=actuation) for _ in range(2))
    signals = {}
    for tick in range(3):
        q = robot.q_home.copy()
        q[7:] += 0.01 * tick
        state = RobotState(q, np.zeros(robot.nv), time=tick * soon.dt)
        known = late.estimator.update(state)
        # The estimate has moved on, and the tick that it is for has not begun.
        np.testing.assert_equal(late.signals(), signals)
        late.lead(known)
        soon.lead(soon.estimator.update(state))
        signals = soon.signals()


@pytest.mark.parametrize(("height", "share"), [(-0.01, 0.0), (0.01, 0.25), (0.05, 1.0)])
def test_a_foot_is_clear_from_a_height_above_the_ground(get_robot, height, share):
    now = footing(get_robot("biped20"), lifted=0.2)
    ground = float(now.sole(1)[2]) - height
    assert now.clearance(ground) == pytest.approx(share)


def test_the_com_comes_down_by_a_part_of_its_height_above_the_ground_that_carries(get_robot):
    robot, lifted = get_robot("biped20"), 0.2
    now = footing(robot, lifted=lifted)
    com = float(now.dynamics.com[2])
    room, _ = com_height(robot, com, stoop_max=0.1).room(now)
    assert room == pytest.approx(com - (0.9 * com - lifted))


def test_over_a_knee_that_is_weak_the_com_comes_down_less(get_robot):
    room = {}
    for name in ("romeo", "human", "humanoid33"):
        teleoperator = StepTeleoperator(get_robot(name))
        state = teleoperator.estimator.update(teleoperator.estimator.dynamics.state)
        teleoperator.lead(state)
        level = teleoperator._level
        level._limit_stoop(replace(level._footing(), mode=Mode.TR))
        room[name] = level._devices.room_below
    assert 0.0 < room["romeo"] < 0.01
    assert 0.01 < room["human"] < 0.1
    assert room["humanoid33"] > 0.1


@pytest.mark.parametrize("room", [0.0, 0.01, 0.03, 1.0])
def test_the_com_comes_down_no_faster_than_it_is_braked_above_what_a_knee_holds(
    get_robot, monkeypatch, room
):
    """It is asked to be 0.2 m lower than it is, and half a metre higher."""
    robot = get_robot("biped20")
    now = footing(robot)
    com = float(now.dynamics.com[2])
    monkeypatch.setattr(FootRange, "too_low", lambda *_, **__: -room)
    monkeypatch.setattr(FootRange, "too_weak", lambda *_, **__: -10.0)
    down = com_height(robot, com - 0.2, dt=1e3).velocity(now, now.sole(1))
    braked = (2.0 * 0.2 * numbers(robot).lift_acceleration * room) ** 0.5
    wanted = 10.0 * min(room, 0.2)
    assert down == pytest.approx(-min(numbers(robot).lift_speed, braked, wanted))
    # Upwards a knee holds more and more.
    up = com_height(robot, com + 0.5, dt=1e3).velocity(now, now.sole(1))
    assert up >= 0.0


@pytest.mark.parametrize("room", [0.0, 0.01, 0.03])
def test_over_one_foot_it_stops_before_the_knee_is_at_its_end_though_it_is_late(
    get_robot, monkeypatch, room
):
    """It goes on as it was for 0.2 s, and is braked then."""
    robot = get_robot("biped20")
    now, both = footing(robot), footing(robot, Mode.D)
    monkeypatch.setattr(FootRange, "too_low", lambda *_, **__: -1.0)
    monkeypatch.setattr(FootRange, "too_weak", lambda *_, **__: -room)
    height = float(now.dynamics.com[2]) - 0.2
    down = -com_height(robot, height, dt=1e3).velocity(now, now.sole(1))
    braking = 0.2 * numbers(robot).lift_acceleration
    assert 0.2 * down + down**2 / (2.0 * braking) == pytest.approx(room, abs=1e-12)
    # Two feet carry more.
    assert -com_height(robot, height, dt=1e3).velocity(both, both.sole(1)) > 0.2


@pytest.mark.parametrize(("mode", "gives"), [(Mode.SL, True), (Mode.D, False)])
def test_a_body_too_low_for_the_knee_that_carries_alone_is_said(
    get_robot, monkeypatch, mode, gives
):
    robot = get_robot("biped20")
    now, height = footing(robot, mode), com_height(robot, 0.7)
    assert not height.room(now)[1]
    monkeypatch.setattr(FootRange, "too_weak", lambda *_, **__: 0.015)
    assert height.room(now)[1] == gives


@pytest.mark.parametrize("height", [0.5, 2.0])
def test_how_high_the_com_goes_does_not_depend_on_where_the_robot_is(
    get_robot, monkeypatch, height
):
    """A COM that is to be higher than the legs are long, and one that is to come down."""
    robot = get_robot("biped20")
    monkeypatch.setattr(f"{ComHeight.__module__}.POSITION_GAIN", 0.1)
    speeds = []
    for at in ((0.0, 0.0), AWAY):
        now = footing(robot, at=at)
        speeds.append(com_height(robot, height, dt=1e3).velocity(now, now.sole(1)))
    assert speeds[0] == pytest.approx(speeds[1], abs=1e-9)
