"""The leader of the balance service: targets of another program, bounded, and balance."""

import math

import numpy as np
import pytest
from balance_runs import Posed, arm_room, run, swing

pytest.importorskip("mujoco")

from poise import RobotState
from poise.apps.balance import BalanceLeader, HandTarget, Targets

ELBOW = "left_elbow_joint"


@pytest.fixture(scope="module")
def g1(get_robot):
    return get_robot("g1")


def at(robot, joint):
    return float(robot.q_home[7 + robot.joint_index(joint)])


# What targets may ask for -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("targets", "fault"),
    [
        ({"joints": {ELBOW: math.nan}}, "finite"),
        ({"joints": {ELBOW: math.inf}}, "finite"),
        ({"joints": {ELBOW: 1e300}}, "at most 100"),
        ({"joints": {"left_elbow": 0.5}}, "left_elbow_joint"),
        ({"joints": {"left_knee_joint": 0.5}}, "no such joint of arms and neck"),
        ({"velocity": (0.0, math.nan, 0.0)}, "finite"),
        ({"hands": {"left": HandTarget((0.2, 0.2, 0.1))}}, "left_hand"),
        ({"hands": {"left_hand": HandTarget((0.2, math.nan, 0.1))}}, "finite"),
        ({"hands": {"left_hand": HandTarget((0.2, 0.2, 0.1), (0.0, 0.0, 0.0, 0.5))}}, "unit"),
        (
            {"hands": {"left_hand": HandTarget((0.2, 0.2, 0.1))}, "joints": {ELBOW: 0.5}},
            "a pose and joints",
        ),
        ({"time": math.nan, "joints": {ELBOW: 0.5}}, "finite"),
    ],
)
def test_a_message_that_cannot_be_is_counted_with_its_fault_and_moves_nothing(g1, targets, fault):
    posed = Posed(g1)
    before = posed.step(joints={ELBOW: at(g1, ELBOW)})
    for _ in range(3):
        now = posed.step(**targets)
    assert posed.leader.refused == 3
    assert fault in posed.leader.reason
    np.testing.assert_allclose(now, before, atol=1e-9)


def test_whatever_is_asked_arms_are_smooth_within_limits_and_off_the_body(g1):
    posed, rng, room = Posed(g1), np.random.default_rng(1), arm_room(g1)
    joints = posed.index - 7
    angles, rooms = [posed.q[posed.index].copy()], []
    asked = {}
    for k in range(320):
        if k % 40 == 0:
            # Far beyond the limits, through trunk, thighs and the other arm.
            size = rng.choice([1.0, 10.0])
            names = [posed.task.joints[j] for j in rng.permutation(14)[:7]]
            asked = {"joints": {name: float(rng.uniform(-size, size)) for name in names}}
            if k % 80 == 0:
                place = tuple(rng.uniform(-0.3, 0.3, 3).tolist())
                left = {n: a for n, a in asked["joints"].items() if n.startswith("left")}
                asked = {"joints": left, "hands": {"right_hand": HandTarget(place)}}
        angles.append(posed.step(**asked))
        rooms.append(room(posed.q))
    assert posed.leader.refused == 0
    angles = np.array(angles)
    assert (angles >= g1.q_min[joints]).all()
    assert (angles <= g1.q_max[joints]).all()
    rates = np.diff(angles, axis=0) / posed.dt
    assert np.abs(rates).max() < 12.0
    # 50 rad/s^2, and more only to stop before a limit.
    assert np.quantile(np.abs(np.diff(rates, axis=0)), 0.999) <= 50.0 * posed.dt + 1e-6
    assert min(rooms) > -0.005
    assert np.ptp(angles, axis=0).min() > 0.3


def test_joints_and_hands_come_where_they_are_asked(g1):
    posed = Posed(g1)
    goal = {ELBOW: 0.4, "right_shoulder_pitch_joint": -0.3}
    for _ in range(150):
        posed.step(joints=goal)
    for joint, angle in goal.items():
        assert posed.q[7 + g1.joint_index(joint)] == pytest.approx(angle, abs=1e-3)
    place = np.array([0.25, 0.2, 0.1])
    for _ in range(300):
        posed.step(hands={"left_hand": HandTarget(tuple(place.tolist()))})
    np.testing.assert_allclose(posed.hand("left_hand"), place, atol=2e-3)
    # The other arm, which no message names, holds.
    at_right = posed.q[7 + g1.joint_index("right_shoulder_pitch_joint")]
    assert at_right == pytest.approx(-0.3, abs=1e-3)


def test_a_neck_follows_its_joints(get_robot):
    robot = get_robot("humanoid33")
    leader = BalanceLeader(robot, dt=0.02)
    (neck,) = (joints for frame, joints in leader.limbs.items() if frame not in robot.hands)
    for k in range(100):
        leader.take(Targets(0.02 * k + 1.0, joints=dict.fromkeys(neck, 0.2)))
        leader.lead(RobotState(robot.q_home, np.zeros(robot.nv), time=0.02 * k))
    np.testing.assert_allclose(leader.stack.task("neck").target_position, 0.2, atol=1e-3)


def test_a_staircase_of_20_hz_becomes_a_line(g1):
    posed, rate, found = Posed(g1, dt=0.005), 0.8, []
    for k in range(200):
        angle = at(g1, ELBOW) + rate * 0.05 * (k // 10)
        found.append(posed.step(**({"joints": {ELBOW: angle}} if k % 10 == 0 else {})))
    speeds = np.diff(np.array(found)[:, posed.task.joints.index(ELBOW)]) / posed.dt
    # As it comes, feedback of 15 /s would change the speed by 0.6 rad/s every 50 ms.
    np.testing.assert_allclose(speeds[100:], rate, atol=0.05)


def test_arms_begin_where_they_are(g1):
    q = g1.q_home.copy()
    q[7 + g1.joint_index(ELBOW)] += 0.5
    posed = Posed(g1, q=q)
    angles = [q[posed.index]] + [posed.step() for _ in range(120)]
    rates = np.diff(angles, axis=0) / posed.dt
    assert np.abs(rates[0]).max() <= 50.0 * posed.dt + 1e-9
    # Without a client they ease to rest.
    np.testing.assert_allclose(angles[-1], g1.q_home[posed.index], atol=0.02)


# Clients that come and go -------------------------------------------------------------------------


def test_a_client_that_stops_leaves_a_robot_that_stops_holds_and_eases_back(g1):
    posed, elbow = Posed(g1, dt=0.02), 7 + g1.joint_index(ELBOW)
    walker = posed.leader.walker

    def say(seconds, **targets):
        for _ in range(round(seconds / posed.dt)):
            posed.step(**targets)

    say(0.1, joints={ELBOW: 0.3})
    say(1.5, joints={ELBOW: 0.3}, velocity=(0.2, 0.0, 0.0))
    assert walker.commands.velocity[0] > 0.1
    held = posed.q[elbow]
    assert held == pytest.approx(0.3, abs=1e-3)
    say(0.6)
    assert posed.leader.lost
    say(4.0)
    assert walker.commands.velocity == (0.0, 0.0, 0.0)
    assert posed.q[elbow] == pytest.approx(held, abs=1e-3)
    say(3.0)
    assert posed.q[elbow] == pytest.approx(at(g1, ELBOW), abs=0.02)


def test_a_velocity_is_cut_to_limits_and_counts_after_one_of_zero(g1):
    posed = Posed(g1)
    walker, fast = posed.leader.walker, (50.0, 0.0, 0.0)
    for _ in range(30):
        posed.step(velocity=fast)
    assert walker.commands.velocity == (0.0, 0.0, 0.0)
    posed.step(velocity=(0.0, 0.0, 0.0))
    for _ in range(200):
        posed.step(velocity=fast)
    assert 0.0 < walker.commands.velocity[0] <= walker.limits.ahead
    assert "taken to" in walker.notice


def test_old_and_repeated_messages_do_not_count(g1):
    posed = Posed(g1)
    posed.step(time=10.0, joints={ELBOW: 0.5})
    before = posed.step(time=10.1, joints={ELBOW: 0.5})
    for stamp in (10.1, 10.05, 9.0):
        posed.step(time=stamp, joints={ELBOW: 1.2})
    assert posed.leader.refused in (2, 3)
    for _ in range(100):
        now = posed.step()
    assert now[posed.task.joints.index(ELBOW)] == pytest.approx(0.5, abs=1e-3)
    assert before[0] == pytest.approx(now[0], abs=1e-3)


# Balance ------------------------------------------------------------------------------------------


def test_the_robot_stands_while_arms_swing(g1):
    done = run(g1, lambda t: Targets(0.0, joints=swing(g1, t)), 0.5)
    assert not done.fallen
    assert done.leader.refused == 0
    assert min(done.rooms) > -0.01


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (0.3, 0.0, 0.2)])
@pytest.mark.parametrize(("load", "cells"), [(0.0, True), (0.0, False), (3.0, True), (3.0, False)])
def test_the_robot_stands_and_walks_while_arms_swing_with_loads(g1, velocity, load, cells):
    def client(time):
        return Targets(0.0, velocity if time > 1.0 else (0.0, 0.0, 0.0), swing(g1, time))

    done = run(g1, client, 8.0, load=load, cells=cells, noise=True)
    assert not done.fallen
    if any(velocity):
        assert done.steps > 6
    if not load:
        # Arms whose load the controller does not know yet sag.
        assert min(done.rooms) > -0.01


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0)])
def test_arms_thrown_about_do_not_topple_it_and_stay_off_the_body(g1, velocity):
    """Targets at random that jump twice a second, in the body and beyond all limits."""
    rng = np.random.default_rng(3)
    drawn = [rng.uniform(-3.0, 3.0, 14) for _ in range(20)]
    names = [n for n in g1.joint_names if any(w in n for w in ("shoulder", "elbow", "wrist"))]

    def client(time):
        angles = dict(zip(names, drawn[int(2.0 * time)].tolist(), strict=True))
        return Targets(0.0, velocity if time > 1.0 else (0.0, 0.0, 0.0), angles)

    done = run(g1, client, 8.0, noise=True)
    assert not done.fallen
    assert min(done.rooms) > -0.02
