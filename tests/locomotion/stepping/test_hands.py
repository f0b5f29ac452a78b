"""Hands follow their devices: what counts of a device, what an arm can do, what a robot does."""

from dataclasses import replace

import numpy as np
import pytest
from led_hands import DT, Follows, Hand, hand
from msgspec import structs
from slow import slow
from walker import hands as device_of, up_and_down

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, replay_teleop, run_teleop
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.locomotion import (
    HandLeader,
    HandStatus,
    Mode,
    OperatorGuard,
    OperatorSample,
    StepTeleoperator,
    TrackedPose,
    WayPoint,
    walking_stack,
)
from poise.robots import capsules_of
from poise.sim import PlantConfig


def gripped():
    """A grip that has just taken hold at 1, 0, 0."""
    return Hand(hand(1.0))


def moved(grip, samples, begin=2):
    """How far a hand goes, given a sample a tick."""
    return sum(grip.tick(s, (begin + k) * DT) for k, s in enumerate(samples))


def test_a_device_moves_its_hand_from_where_both_are_while_its_clutch_is_closed():
    grip = gripped()
    assert grip.engaged
    way = moved(grip, [hand(1.02), hand(0.5, clutch=False), hand(0.2, clutch=False), hand(0.2)])
    assert grip.engaged
    np.testing.assert_allclose(way, [0.02, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(moved(grip, [hand(0.23, 0.01)], 6), [0.03, 0.01, 0.0], atol=1e-12)


def test_a_clutch_that_is_closed_when_it_is_found_leads_nothing_until_it_was_open():
    grip = Hand()
    assert not moved(grip, [hand(0.0), hand(0.1), hand(0.2)]).any()
    assert not grip.engaged


@pytest.mark.parametrize("bad", [None, hand(np.nan), hand(1.4)], ids=str)
def test_a_bad_place_is_refused_and_after_half_a_second_takes_hold_anew(bad):
    grip = gripped()
    assert not moved(grip, [bad]).any()
    assert grip.engaged
    np.testing.assert_allclose(moved(grip, [hand(1.01)], 3), [0.01, 0.0, 0.0], atol=1e-12)
    ticks = round(0.6 / DT)
    assert not moved(grip, [bad] * ticks, 4).any()
    assert not grip.engaged
    assert not moved(grip, [hand(1.0), hand(1.1)], 4 + ticks).any()
    moved(grip, [hand(1.1, clutch=False), hand(1.1)], 6 + ticks)
    assert grip.engaged


def test_no_stream_of_samples_moves_a_hand_faster_than_it_may():
    rng, grip = np.random.default_rng(5), gripped()
    ways = [np.zeros(3)]
    for k in range(2, 2000):
        said = rng.random()
        place = rng.normal(1.0, 0.3, 3)
        new = None if said < 0.5 else TrackedPose.of(place, said < 0.98)
        ways.append(ways[-1] + grip.tick(new, k * DT))
    ways = np.array(ways)
    for ticks in (1, 5, 50, 500):
        far = np.linalg.norm(ways[ticks:] - ways[:-ticks], axis=1).max()
        assert far <= 0.06 + 2.5 * DT * ticks + 1e-9


@pytest.mark.parametrize("later", [10.0, -10.0])
def test_a_clutch_that_was_open_long_ago_takes_no_hold(later):
    guard = OperatorGuard(dt=DT)

    def say(time, clutch):
        part = TrackedPose((0.0, 0.0, 0.0), clutch, (0.0, 0.0, 0.0, 1.0))
        guard.check(OperatorSample(time, hands=(part, None), head=part), time)
        return guard.hands[0].engaged, guard.head is not None

    say(0.0, False)
    for time in (later, later + DT):
        assert say(time, True) == (False, False)
    say(later + 2 * DT, False)
    assert say(later + 3 * DT, True) == (True, True)


# The leader ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "dt"), [("g1", 0.005), slow("biped20", DT), slow("humanoid33", DT), slow("talos", DT)]
)
def test_wherever_hands_are_led_arms_are_smooth_within_limits_and_off_the_body(get_robot, name, dt):
    robot, rng = get_robot(name), np.random.default_rng(2)
    arms = Follows(robot, dt=dt)
    joints = np.array(arms.index) - 7
    home = robot.q_home[arms.index]
    lower, upper = np.minimum(robot.q_min[joints], home), np.maximum(robot.q_max[joints], home)
    capsules, start = capsules_of(robot), [arms.pose(side)[0] for side in (0, 1)]
    margins, least = np.minimum(0.03, capsules.at_home - 0.01), np.inf
    middle, angles, hands = 0.5 * (start[0] + start[1]), [home], [np.array(start)]
    devices = [hand(0.0, clutch=False)] * 2
    goals = [np.zeros(3)] * 2
    for k in range(round(3.0 / dt)):
        if k % round(0.4 / dt) == 1:
            # Into the trunk, the other hand's side, the thighs; and out of reach.
            size = rng.choice([0.25, 1.0])
            goals = [middle - here + rng.uniform(-size, size, 3) for here in start]
        arms.say(*devices)
        steps = [goal - device.position for goal, device in zip(goals, devices, strict=True)]
        ways = [step * min(1.0, 2.5 * dt / max(np.linalg.norm(step), 1e-9)) for step in steps]
        devices = [
            hand(*(way + device.position)) for way, device in zip(ways, devices, strict=True)
        ]
        angles.append(arms.leader.task.target_position)
        hands.append(np.array([arms.pose(side)[0] for side in (0, 1)]))
        if k % 20 == 0:
            least = min(least, (capsules.distances(robot, arms.q) - margins).min())
    angles, speeds = np.array(angles), np.diff(hands, axis=0) / dt
    assert (lower - 1e-9 <= angles).all()
    assert (angles <= upper + 1e-9).all()
    rates = np.diff(angles, axis=0) / dt
    assert (np.abs(rates) <= robot.v_max[joints] + 1e-6).all()
    assert np.abs(np.diff(rates, axis=0)).max() <= 60.0 * dt + 1e-6
    # The others cannot take back in one tick what the last joints do beside their limits.
    assert np.linalg.norm(speeds, axis=2).max() < 3.0
    assert np.linalg.norm(np.diff(speeds, axis=0) / dt, axis=2).max() < 60.0
    # Braked as hands are, they come a centimetre nearer: half way to what the stack keeps.
    assert least > -0.015
    released = [hand(*device.position, clutch=False) for device in devices]
    arms.say(*released, seconds=4.0, rest=True)
    np.testing.assert_allclose(arms.leader.task.target_position, home, atol=0.02)


def test_a_hand_follows_is_held_and_comes_back_to_rest(get_robot):
    robot = Follows(get_robot("g1"))
    leader, start = robot.leader, robot.leader.places[0].copy()
    home = leader.task.target_position
    assert leader.status == [HandStatus.REST, HandStatus.REST]
    robot.say(hand(0.0, clutch=False), None)
    robot.say(hand(0.0), None)
    robot.say(hand(0.1, 0.0, 0.1), None, 1.0)
    assert leader.status == [HandStatus.LED, HandStatus.REST]
    np.testing.assert_allclose(leader.places[0], start + [0.1, 0.0, 0.1], atol=1e-9)
    np.testing.assert_allclose(robot.pose(0)[0], leader.places[0], atol=1e-3)
    robot.say(hand(0.4, clutch=False), None, 1.0)
    assert leader.status[0] is HandStatus.HELD
    np.testing.assert_allclose(leader.places[0], start + [0.1, 0.0, 0.1], atol=1e-9)
    # The button does nothing to a hand that is held.
    robot.say(hand(0.4), None, rest=True)
    assert leader.status[0] is HandStatus.LED
    robot.say(hand(0.4, clutch=False), None, 3.0, rest=True)
    assert leader.status[0] is HandStatus.REST
    np.testing.assert_allclose(leader.task.target_position, home, atol=0.02)
    np.testing.assert_allclose(leader.places[0], start, atol=0.02)


def test_motion_is_scaled_and_no_faster_than_it_may_be_whatever_a_device_says(get_robot):
    robot = Follows(get_robot("g1"), scale=2.0, speed_max=0.3)
    start = robot.leader.places[1].copy()
    robot.say(None, hand(0.0, clutch=False))
    robot.say(None, hand(0.0))
    before = robot.pose(1)[0]
    for _ in range(250):
        robot.say(None, hand(0.03, 0.02, 0.05, velocity=(0.1, 0.0, 0.2)))
        now = robot.pose(1)[0]
        assert np.linalg.norm(now - before) < 1.1 * 0.3 * DT
        before = now
    np.testing.assert_allclose(robot.leader.places[1], start + [0.06, 0.04, 0.1], atol=1e-9)


def test_beyond_its_reach_a_hand_says_so_and_comes_back_with_its_device(get_robot):
    robot = Follows(get_robot("g1"))
    leader = robot.leader
    robot.say(hand(0.0, clutch=False), None)
    for x in np.arange(0.0, 0.9, 0.004):
        robot.say(hand(x), None)
    robot.say(hand(x), None, 0.5)
    assert leader.status[0] is HandStatus.REACH
    edge = leader.places[0].copy()
    for back in np.arange(0.0, 0.1, 0.002):
        robot.say(hand(x - back), None)
    assert leader.status[0] is HandStatus.LED
    # The device is half a metre beyond the edge, and the hand not.
    assert leader.places[0][0] < edge[0] - 0.06


def test_what_is_no_number_is_refused_and_robots_without_arms_are_led_by_nothing(get_robot):
    with pytest.raises(ConfigurationError, match="scale of the hands"):
        HandLeader(get_robot("g1"), dt=DT, scale=0.0)
    robot = replace(get_robot("biped20"), hands=())
    leader = HandLeader(robot, dt=DT)
    leader.lead(OperatorGuard(dt=DT), RobotState(robot.q_home, np.zeros(robot.nv)))
    assert (leader.task, leader.status, leader.places) == (None, [], [])
    assert StepTeleoperator(robot, actuation="torque").stack.task("posture").dim == robot.nj


def test_joints_that_are_not_numbers_teach_nothing_and_raise_nothing(get_robot):
    robot = get_robot("g1")
    leader, guard, q = HandLeader(robot, dt=DT), OperatorGuard(dt=DT), robot.q_home.copy()
    q[-1] = np.nan
    for tick in range(20):
        state = RobotState(q if tick % 2 else robot.q_home, np.zeros(robot.nv), time=tick * DT)
        said = OperatorSample(tick * DT, hands=(hand(0.001 * tick, clutch=tick > 0), None))
        guard.check(said, tick * DT)
        leader.lead(guard, state)
        assert np.isfinite(leader.task.target_position).all()


@pytest.mark.parametrize("only", ["left_hand", "right_hand"])
def test_the_only_hand_is_led_by_the_one_on_its_side(get_robot, only):
    robot = replace(get_robot("humanoid33"), hands=(only,))
    for side, name in enumerate(("left_hand", "right_hand")):
        leads = Follows(robot)
        for clutch in (False, True):
            leads.say(*(hand(0.0, clutch=clutch) if foot == side else None for foot in (0, 1)))
        assert (leads.leader.status == [HandStatus.LED]) is (name == only)


# The robot ----------------------------------------------------------------------------------------


def operator(teleoperator, points=()):
    """Feet by way-points, and hands that go around in opposite directions at some 0.6 m/s."""
    feet = device_of(*points)(teleoperator)

    class Both:
        def sample(self, time):
            clutch, angle = time >= 0.5, 6.0 * max(time - 0.5, 0.0)
            x, z = 0.1 * np.sin(angle), 0.1 - 0.1 * np.cos(angle)
            pair = hand(x, 0.0, z, clutch), hand(-x, 0.0, z, clutch)
            return structs.replace(feet.sample(time), hands=pair)

    return Both()


@pytest.mark.slow
@pytest.mark.parametrize("points", [[], up_and_down()], ids=["standing", "stepping"])
def test_g1_swings_its_arms_with_a_load_it_does_not_know_of(get_robot, points, tmp_path):
    robot, path = get_robot("g1"), tmp_path / "hands.mcap"
    load = PlantConfig.Payload(frame="right_hand", mass=1.0)
    plant = replace(TORQUE_TELEOP_PLANT.with_noise(), payloads=(load,))
    run = run_teleop(
        robot, lambda t: operator(t, points), plant, duration=3.0, seed=1, recording=path
    )
    log = run.log
    assert not run.fell
    assert log.tilt.max() < 0.25
    assert len(log.entries(Mode.SL)) == bool(points)
    assert run.teleoperator.status.hands == (HandStatus.LED, HandStatus.LED)
    if not points:
        np.testing.assert_allclose(log.com[-1, :2], log.zmp_reference[-1], atol=0.01)
        dynamics = Dynamics(robot)
        dynamics.update(RobotState(log.q[-1], np.zeros(robot.nv)))
        for name in robot.hands:
            place = dynamics.frame(robot.frame_id(name)).position
            target = run.record[f"target/{name}"][-1]
            assert np.linalg.norm(place - target) < 0.12
        again = replay_teleop(path, robot)
        assert np.array_equal(again.log.command, log.command)


@pytest.mark.slow
def test_a_load_that_the_model_is_told_of_leaves_the_com_where_it_should_be(get_robot):
    """Unknown it is a third of a kilogram metre off, and the CoM by millimetres."""
    robot = get_robot("g1")
    load = PlantConfig.Payload(frame="right_hand", mass=1.5)
    plant = replace(TORQUE_TELEOP_PLANT, payloads=(load,))
    out = WayPoint(at=1.5, right_hand=(0.2, 0.0, 0.15))
    device = device_of(WayPoint(at=0.3, right_hand=(0.0, 0.0, 0.0)), out)
    off = []
    for told in (robot, robot.carrying("right_hand", 1.5)):
        run = run_teleop(told, device, plant, duration=4.0)
        assert run.teleoperator.status.hands == (HandStatus.REST, HandStatus.LED)
        off.append(np.linalg.norm(run.record["com"][-1, :2] - run.log.zmp_reference[-1]))
    assert off[1] < 0.001
    assert off[0] > 5.0 * off[1]


def test_hands_stand_below_the_balance(get_robot):
    robot = get_robot("g1")
    teleoperator = StepTeleoperator(robot, actuation="torque")
    teleoperator.lead(teleoperator.estimator.update(teleoperator.estimator.dynamics.state))
    com, arms = (teleoperator.stack.task(name) for name in ("com", "arms"))
    # By weight, as far as numbers go: while the robot catches itself a foot counts as the CoM does.
    assert com.weight[:2].min() > 1e6 * arms.weight.max()
    assert com.weight[2] > 30.0 * arms.weight.max()
    leader = HandLeader(robot, dt=DT)
    stack = walking_stack(robot, leader.task)
    stack.bind(robot)
    assert [leader.task in level for level in stack.levels] == [True, False]
    assert 30.0 * leader.task.weight.max() < stack.task("com").weight.min()
