"""Hands follow their devices: what counts of a device, what an arm can do, what a robot does."""

from dataclasses import replace

import numpy as np
import pytest
from led_hands import DT, Arms, Follows, Hand, both
from msgspec import structs
from slow import slow
from walker import hands as device_of, up_and_down

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, replay_teleop, run_teleop
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError, UnknownNameError
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


def hand(x, y=0.0, z=0.0, clutch=True):
    return TrackedPose.of((x, y, z), clutch)


def gripped():
    """A grip that has just taken hold at 1, 0, 0."""
    grip = Hand()
    grip.update(hand(1.0, clutch=False), 0.0)
    grip.update(hand(1.0), DT)
    return grip


def moved(grip, samples, begin=2):
    """How far a hand goes, given a sample a tick."""
    return sum(grip.tick(s, (begin + k) * DT) for k, s in enumerate(samples))


def test_a_device_moves_its_hand_from_where_both_are():
    grip = gripped()
    assert grip.engaged
    np.testing.assert_allclose(moved(grip, [hand(1.02, 0.01)]), [0.02, 0.01, 0.0], atol=1e-12)


def test_what_moves_while_the_clutch_is_open_does_not_count():
    grip = gripped()
    way = moved(grip, [hand(1.02), hand(0.5, clutch=False), hand(0.2, clutch=False), hand(0.2)])
    assert grip.engaged
    np.testing.assert_allclose(way, [0.02, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(moved(grip, [hand(0.23)], 6), [0.03, 0.0, 0.0], atol=1e-12)


def test_a_clutch_that_is_closed_when_it_is_found_leads_nothing_until_it_was_open():
    grip = Hand()
    assert not moved(grip, [hand(0.0), hand(0.1), hand(0.2)]).any()
    assert not grip.engaged


@pytest.mark.parametrize("bad", [hand(np.nan), hand(1.4), hand(np.inf)], ids=str)
def test_a_bad_place_is_refused_and_the_hand_stays(bad):
    grip = gripped()
    assert not moved(grip, [bad]).any()
    assert grip.engaged
    np.testing.assert_allclose(moved(grip, [hand(1.01)], 3), [0.01, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("silence", [None, hand(np.nan), hand(9.0)], ids=str)
def test_a_device_without_a_good_sample_for_half_a_second_lets_go_until_it_takes_hold_anew(silence):
    grip = gripped()
    ticks = round(0.6 / DT)
    assert not moved(grip, [silence] * ticks).any()
    assert not grip.engaged
    assert not moved(grip, [hand(1.0), hand(1.1)], 2 + ticks).any()
    moved(grip, [hand(1.1, clutch=False), hand(1.1)], 4 + ticks)
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


# Arms ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["g1", slow("biped20"), slow("humanoid33"), slow("talos")])
def test_whatever_is_asked_for_arms_move_smoothly_and_within_their_limits(get_robot, name):
    robot, rng = get_robot(name), np.random.default_rng(2)
    arms = Arms(robot)
    index = [robot.joint_index(joint) for joint in arms.joints]
    home = robot.q_home[7:][index]
    lower, upper = np.minimum(robot.q_min[index], home), np.maximum(robot.q_max[index], home)
    goals, hands = [], []
    for k in range(3000):
        if k % 300 == 0:
            goals = [
                None if rng.random() < 0.2 else here + rng.uniform(-1.0, 1.0, 3)
                for here in arms.hands
            ]
        arms.advance(goals)
        assert (lower - 1e-9 <= arms.q).all()
        assert (arms.q <= upper + 1e-9).all()
        assert (np.abs(arms.v) <= robot.v_max[index]).all()
        hands.append(np.concatenate(arms.hands))
    speeds = np.diff(hands, axis=0).reshape(-1, 2, 3) / DT
    # What the last joints do beside their limits, others cannot take back at once.
    assert np.linalg.norm(speeds, axis=2).max() < 3.0
    assert np.linalg.norm(np.diff(speeds, axis=0) / DT, axis=2).max() < 60.0


def test_a_hand_gets_where_it_can_and_says_where_it_cannot(get_robot):
    robot = get_robot("g1")
    arms = Arms(robot)
    near, far = arms.hands[0] + [0.1, 0.05, 0.15], arms.hands[1] + [1.0, 0.0, 0.0]
    for _ in range(1000):
        arms.advance([near, far])
    np.testing.assert_allclose(arms.hands[0], near, atol=1e-3)
    assert arms.each("blocked") == [False, True]


@pytest.mark.parametrize("name", ["g1", slow("humanoid33"), slow("biped20")])
def test_arms_stay_off_the_body_and_each_other_wherever_hands_are_led(get_robot, name):
    robot, rng = get_robot(name), np.random.default_rng(4)
    capsules, q = capsules_of(robot), robot.q_home.copy()
    arms = Arms(robot)
    places = [7 + robot.joint_index(joint) for joint in arms.joints]
    margins, start = np.minimum(0.03, capsules.at_home - 0.01), [h.copy() for h in arms.hands]
    middle, least = 0.5 * (start[0] + start[1]), np.inf
    for k in range(800):
        if k % 200 == 0:
            # Into the trunk, the other hand's side, the thighs.
            goals = [middle + rng.uniform(-0.25, 0.25, 3) for _ in start]
        arms.advance(goals)
        if k % 20 == 0:
            q[places] = arms.q
            least = min(least, (capsules.distances(robot, q) - margins).min())
    # Braked as hands are, they come a centimetre nearer: half way to what the stack keeps.
    assert least > -0.015
    for _ in range(1500):
        arms.advance([None, None])
    np.testing.assert_allclose(arms.hands, start, atol=0.02)


def test_the_model_of_the_arms_is_the_robots(get_robot):
    """Its hands are where the robot's are, seen from the torso."""
    robot, rng = get_robot("g1"), np.random.default_rng(0)
    arms = Arms(robot)
    for _ in range(400):
        arms.advance([here + rng.normal(0.1, 0.1, 3) for here in arms.hands])
    q = robot.q_home.copy()
    q[:7] = [0.3, 0.2, 1.0, 0.0, 0.6, 0.0, 0.8]
    q[[7 + robot.joint_index(name) for name in arms.joints]] = arms.q
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(q, np.zeros(robot.nv)))
    torso = dynamics.frame(robot.frame_id(robot.torso))
    for name, here in zip(robot.hands, arms.hands, strict=True):
        place = dynamics.frame(robot.frame_id(name)).position
        np.testing.assert_allclose(torso.rotation.T @ (place - torso.position), here, atol=1e-9)


# The leader ---------------------------------------------------------------------------------------


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


def test_motion_is_scaled(get_robot):
    robot = Follows(get_robot("g1"), scale=2.0)
    start = robot.leader.places[1].copy()
    robot.say(None, hand(0.0, clutch=False))
    robot.say(None, hand(0.0))
    robot.say(None, hand(0.03, 0.02, 0.05), 0.5)
    np.testing.assert_allclose(robot.leader.places[1], start + [0.06, 0.04, 0.1], atol=1e-9)


def test_beyond_its_reach_a_hand_says_so_and_comes_back_with_its_device(get_robot):
    robot = Follows(get_robot("g1"))
    leader = robot.leader
    robot.say(hand(0.0, clutch=False), None)
    for x in np.arange(0.0, 0.9, 0.002):
        robot.say(hand(x), None)
    robot.say(hand(x), None, 0.5)
    assert leader.status[0] is HandStatus.REACH
    edge = leader.places[0].copy()
    for back in np.arange(0.0, 0.1, 0.002):
        robot.say(hand(x - back), None)
    assert leader.status[0] is HandStatus.LED
    # The device is half a metre beyond the edge, and the hand not.
    assert leader.places[0][0] < edge[0] - 0.06


def test_samples_that_are_old_or_far_ahead_lead_no_hand(get_robot):
    robot = Follows(get_robot("g1"))
    leader, state = robot.leader, RobotState(robot.robot.q_home, np.zeros(robot.robot.nv), time=1.0)

    def led(stamp, clutch=True):
        robot.guard.check(both(stamp, hand(0.0, clutch=clutch)), state.time)
        leader.lead(robot.guard, state)
        return leader.status[0]

    stamps = (5.0, 4.9, 5.0, 7.0, np.nan)
    said = [led(stamp, clutch=k > 0) for k, stamp in enumerate(stamps)]
    assert said == [HandStatus.REST] * 5
    assert led(5.1) is HandStatus.LED


def test_what_is_no_number_is_refused_and_robots_without_arms_are_led_by_nothing(get_robot):
    with pytest.raises(ConfigurationError, match="scale of the hands"):
        HandLeader(get_robot("g1"), dt=DT, scale=0.0)
    robot = replace(get_robot("biped20"), hands=())
    leader = HandLeader(robot, dt=DT)
    leader.lead(OperatorGuard(dt=DT), RobotState(robot.q_home, np.zeros(robot.nv)))
    assert (leader.task, leader.status, leader.places) == (None, [], [])
    assert StepTeleoperator(robot, actuation="torque").stack.task("posture").dim == robot.nj


# The robot ----------------------------------------------------------------------------------------


def circling(start=0.5):
    """Hands that go around in opposite directions at some 0.6 m/s."""

    def make(time):
        if time < start:
            return hand(0.0, clutch=False), hand(0.0, clutch=False)
        angle = 6.0 * (time - start)
        x, z = 0.1 * np.sin(angle), 0.1 - 0.1 * np.cos(angle)
        return hand(x, 0.0, z), hand(-x, 0.0, z)

    return make


def operator(points, make):
    """Feet by way-points, and hands."""

    def device(teleoperator):
        feet = device_of(*points)(teleoperator)

        class Both:
            def sample(self, time):
                return structs.replace(feet.sample(time), hands=make(time))

        return Both()

    return device


@pytest.mark.slow
@pytest.mark.parametrize("points", [[], up_and_down()], ids=["standing", "stepping"])
def test_g1_swings_its_arms_with_a_load_it_does_not_know_of(get_robot, points, tmp_path):
    robot, path = get_robot("g1"), tmp_path / "hands.mcap"
    load = PlantConfig.Payload(frame="right_hand", mass=1.0)
    plant = replace(TORQUE_TELEOP_PLANT.with_noise(), payloads=(load,))
    run = run_teleop(
        robot, operator(points, circling()), plant, duration=3.0, seed=1, recording=path
    )
    log = run.log
    assert not run.fell
    assert log.tilt.max() < 0.25
    assert len(log.entries(Mode.SL)) == bool(points)
    assert run.teleoperator.status.hands == (HandStatus.LED, HandStatus.LED)
    if not points:
        np.testing.assert_allclose(log.com[-1, :2], log.zmp_reference[-1], atol=0.01)
        state = RobotState(log.q[-1], np.zeros(robot.nv))
        dynamics = Dynamics(robot)
        dynamics.update(state)
        for name in robot.hands:
            place = dynamics.frame(robot.frame_id(name)).position
            target = run.record[f"target/{name}"][-1]
            assert np.linalg.norm(place - target) < 0.12
        again = replay_teleop(path, robot)
        assert np.array_equal(again.log.command, log.command)


@pytest.mark.slow
def test_a_load_that_the_model_is_told_of_leaves_the_com_where_it_should_be(get_robot):
    """Unknown it is a third of a kilogram metre off, and the COM by millimetres."""
    robot = get_robot("g1")
    load = PlantConfig.Payload(frame="right_hand", mass=1.5)
    plant = replace(TORQUE_TELEOP_PLANT, payloads=(load,))
    points = [WayPoint(at=0.3, right_hand=(0.0, 0.0, 0.0)), WayPoint(at=1.5, right_hand=FORWARD)]
    off = []
    for told in (robot, robot.carrying("right_hand", 1.5)):
        run = run_teleop(told, device_of(*points), plant, duration=4.0)
        assert run.teleoperator.status.hands == (HandStatus.REST, HandStatus.LED)
        off.append(np.linalg.norm(run.record["com"][-1, :2] - run.log.zmp_reference[-1]))
    assert off[1] < 0.001
    assert off[0] > 5.0 * off[1]


def test_what_a_robot_carries_is_in_its_model(get_robot):
    robot = get_robot("g1")
    loaded = robot.carrying("left_hand", 2.0, (0.1, 0.0, 0.0))
    assert loaded.mass == pytest.approx(robot.mass + 2.0)
    dynamics, without = Dynamics(loaded), Dynamics(robot)
    for each in (dynamics, without):
        each.update(RobotState(robot.q_home, np.zeros(robot.nv)))
    hand = without.frame(robot.frame_id("left_hand"))
    load = hand.position + hand.rotation @ [0.1, 0.0, 0.0]
    expected = (robot.mass * without.com + 2.0 * load) / (robot.mass + 2.0)
    np.testing.assert_allclose(dynamics.com, expected, atol=1e-9)
    with pytest.raises(UnknownNameError, match="third_hand"):
        robot.carrying("third_hand", 1.0)
    for bad in ((-1.0, (0.0, 0.0, 0.0)), (1.0, (np.nan, 0.0, 0.0)), (1.0, (0.0, 0.0))):
        with pytest.raises(ConfigurationError, match="of the load"):
            robot.carrying("left_hand", *bad)


FORWARD = (0.2, 0.0, 0.15)


def test_hands_stand_below_the_balance(get_robot):
    teleoperator = StepTeleoperator(get_robot("g1"), actuation="torque")
    state = teleoperator.estimator.update(teleoperator.estimator.dynamics.state)
    teleoperator.lead(state)
    com, arms = (teleoperator.stack.task(name) for name in ("com", "arms"))
    # By weight, as far as numbers go: while the robot catches itself a foot counts as the COM does.
    assert com.weight[:2].min() > 1e6 * arms.weight.max()
    assert com.weight[2] > 30.0 * arms.weight.max()
    leader = HandLeader(teleoperator.robot, dt=DT)
    stack = walking_stack(teleoperator.robot, leader.task)
    stack.bind(teleoperator.robot)
    assert [leader.task in level for level in stack.levels] == [True, False]
    assert 30.0 * leader.task.weight.max() < stack.task("com").weight.min()
    assert not {task.name for _, task in stack.tasks()} & set(teleoperator.robot.hands)


def test_joints_that_are_not_numbers_teach_nothing_and_raise_nothing(get_robot):
    robot = get_robot("g1")
    leader = HandLeader(robot, dt=DT)
    good = RobotState(robot.q_home, np.zeros(robot.nv))
    q = robot.q_home.copy()
    q[-1] = np.nan
    for tick, state in enumerate((good, replace(good, q=q), good)):
        leader.lead(OperatorGuard(dt=DT), replace(state, time=tick * DT))
        np.testing.assert_allclose(leader.task.target_position, robot.q_home[-14:], atol=1e-9)
        assert np.isfinite(leader._arms.bias).all()


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


@pytest.mark.parametrize("only", ["left_hand", "right_hand"])
def test_the_only_hand_is_led_by_the_one_on_its_side(get_robot, only):
    robot = replace(get_robot("humanoid33"), hands=(only,))
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    for side, name in enumerate(("left_hand", "right_hand")):
        leader, guard = HandLeader(robot, dt=DT), OperatorGuard(dt=DT)
        for tick, clutch in enumerate((False, True)):
            held = hand(0.0, clutch=clutch)
            hands = (held, None) if side == 0 else (None, held)
            guard.check(OperatorSample((tick + 1) * DT, hands=hands), tick * DT)
            leader.lead(guard, state)
        assert (leader.status == [HandStatus.LED]) is (name == only)
