"""Hands are turned as their devices are: what counts of it, what arms can do, what robots do."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from led_hands import DT, Follows, Hand
from unchecked import run_unchecked
from walker import hands as device_of, up_and_down

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, replay_teleop, run_teleop
from poise.dynamics import Dynamics, RobotState
from poise.locomotion import HandStatus, TrackedPose, WayPoint


def quaternion(*turn):
    return np.array(pin.Quaternion(pin.exp3(np.array(turn))).coeffs())


def hand(*turn, x=0.0, clutch=True):
    return TrackedPose.of((x, 0.0, 0.0), clutch, quaternion(*turn))


def angle(one, other):
    return float(np.linalg.norm(pin.log3(one @ other.T)))


def turned(grip, samples, begin=2):
    """How a hand is turned, given a sample a tick."""
    rotation = np.eye(3)
    for k, sample in enumerate(samples):
        grip.tick(sample, (begin + k) * DT)
        rotation = pin.exp3(grip.turn) @ rotation
    return rotation


def test_a_hand_turns_by_what_its_device_turned_along_the_same_axes():
    """However the device was held when its clutch closed."""
    for start in ((0.0, 0.0, 0.0), (0.4, -0.9, 0.3)):
        grip = Hand(hand(*start))
        assert grip.turns
        way = pin.exp3(np.array([0.1, 0.0, 0.05]))
        held = pin.Quaternion(way @ pin.exp3(np.array(start))).coeffs()
        rotation = turned(grip, [TrackedPose.of(np.zeros(3), True, held)] * 10)
        np.testing.assert_allclose(rotation, way, atol=1e-9)


BAD = {
    "not a number": np.array([0.0, 0.0, 0.0, np.nan]),
    "too long": np.array([0.0, 0.0, 0.0, 1.1]),
    "nothing": np.zeros(4),
    "elsewhere": quaternion(0.0, 2.0, 0.0),
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD)
def test_an_orientation_that_cannot_be_is_refused_and_the_hand_stays(bad):
    grip = Hand(hand(0.0, 0.0, 0.0))
    sample = TrackedPose.of((0.01, 0.0, 0.0), True, bad)
    assert not grip.tick(sample, 2 * DT).any()
    assert not grip.turn.any()
    assert grip.engaged
    np.testing.assert_array_equal(turned(grip, [sample] * 300, 3), np.eye(3))
    # Half a second of it, and the device is lost until its clutch was open.
    assert not grip.engaged
    assert not grip.tick(hand(0.0, 0.0, 0.0), 303 * DT).any()
    assert not grip.engaged


def test_an_orientation_that_comes_again_turns_from_there_on():
    grip = Hand(hand(0.0, 0.0, 0.0))
    without = TrackedPose.of(np.zeros(3), True)
    rotation = turned(grip, [hand(0.1, 0, 0)] * 5 + [without] * 5 + [hand(0.8, 0, 0)] * 5)
    np.testing.assert_allclose(rotation, pin.exp3(np.array([0.1, 0.0, 0.0])), atol=1e-9)
    rotation = turned(grip, [hand(0.85, 0, 0)] * 5, 17)
    np.testing.assert_allclose(rotation, pin.exp3(np.array([0.05, 0.0, 0.0])), atol=1e-9)


@pytest.mark.parametrize("every", [1, 7, 40])
def test_no_stream_of_samples_turns_a_hand_faster_than_it_may(every):
    rng, grip = np.random.default_rng(5), Hand(hand(0.0, 0.0, 0.0))
    rotations = [np.eye(3)]
    for k in range(2, 2000):
        new = None
        if k % every == 0:
            new = hand(*rng.uniform(-0.7, 0.7, 3), clutch=rng.random() < 0.98)
        grip.tick(new, k * DT)
        rotations.append(pin.exp3(grip.turn) @ rotations[-1])
    for ticks in (1, 5, 50, 300):
        far = max(angle(b, a) for a, b in zip(rotations, rotations[ticks:], strict=False))
        assert far <= 0.12 + 3.0 * DT * ticks + 1e-9


COMPILED = """
import json, sys
sys.path.insert(0, sys.argv[1])
import numpy as np
import poise
from poise.dynamics import RobotState
from poise.locomotion import GazeLeader, HandLeader, OperatorGuard, OperatorSample, TrackedPose
from test_nothing_compiles_in_a_tick import signatures
robot, turn = poise.load_robot("humanoid33"), (0.0, 0.0, 0.1, np.sqrt(0.99))
hands, gaze = HandLeader(robot, dt=0.002), GazeLeader(robot, dt=0.002)
guard = OperatorGuard(dt=0.002)
before = signatures()
for k in range(200):
    hand, head = (TrackedPose((0.0, 0.0, 0.001 * k), k > 1, turn) for _ in (0, 1))
    guard.check(OperatorSample(0.002 * k, hands=(hand, hand), head=head), 0.002 * k)
    hands.lead(guard, RobotState(robot.q_home, np.zeros(robot.nv), time=0.002 * k))
    gaze.lead(guard)
turned = hands.rotations[0] is not None and np.abs(gaze.gaze - np.eye(3)).max() > 0.05
print(json.dumps([before, signatures(), bool(turned)]))
"""


def test_once_leaders_are_made_nothing_is_compiled():
    control = Path(__file__).parents[2] / "control"
    before, after, turned = run_unchecked(COMPILED, control)
    assert turned
    assert {key: n for key, n in after.items() if n != before.get(key, 0)} == {}


# The leader ---------------------------------------------------------------------------------------


def test_a_hand_is_turned_regripped_held_and_comes_back_to_rest(get_robot):
    robot = Follows(get_robot("g1"), scale=2.0)
    leader, start = robot.leader, robot.pose(1)[1]
    robot.say(None, hand(0.0, 0.0, 0.3, clutch=False))
    robot.say(None, hand(0.0, 0.0, 0.3))
    robot.say(None, hand(0.0, 0.0, 0.6), 1.0)
    way = pin.exp3(np.array([0.0, 0.0, 0.3]))
    assert angle(robot.pose(1)[1], way @ start) < 0.01
    assert leader.status[1] is HandStatus.LED
    assert leader.rotations[0] is None
    place = leader.places[1].copy()
    robot.say(None, hand(0.7, 0.0, 0.0, clutch=False), 0.5)
    assert leader.status[1] is HandStatus.HELD
    robot.say(None, hand(0.7, 0.0, 0.0), 0.5)
    assert angle(robot.pose(1)[1], way @ start) < 0.01
    robot.say(None, hand(0.9, 0.0, 0.0), 1.0)
    assert angle(robot.pose(1)[1], pin.exp3(np.array([0.2, 0.0, 0.0])) @ way @ start) < 0.07
    np.testing.assert_allclose(leader.places[1], place, atol=1e-6)
    # Without orientation it keeps the one that it has.
    robot.say(None, TrackedPose.of(np.zeros(3), False))
    robot.say(None, TrackedPose.of(np.zeros(3), True))
    robot.say(None, TrackedPose.of((0.02, 0.0, 0.02), True), 1.0)
    assert angle(robot.pose(1)[1], pin.exp3(np.array([0.2, 0.0, 0.0])) @ way @ start) < 0.07
    robot.say(None, TrackedPose.of(np.zeros(3), False), 3.0, rest=True)
    assert leader.rotations[1] is None
    assert angle(robot.pose(1)[1], start) < 0.02


def test_turned_as_far_as_it_goes_a_hand_says_so_and_comes_back_with_its_device(get_robot):
    robot = Follows(get_robot("g1"))
    leader, start = robot.leader, robot.pose(1)[1]
    robot.say(None, hand(0.0, 0.0, 0.0, clutch=False))
    for y in np.arange(0.0, 1.5, 0.01):
        robot.say(None, hand(0.0, -y, 0.0), 0.01)
    robot.say(None, hand(0.0, -y, 0.0), 0.5)
    assert leader.status[1] is HandStatus.TURNED
    far = angle(robot.pose(1)[1], start)
    assert 0.1 < far < 1.4
    for back in np.arange(y, 0.0, -0.01):
        robot.say(None, hand(0.0, -back, 0.0), 0.01)
    assert leader.status[1] is HandStatus.LED
    # The device went up to a radian further than the hand, and that is forgiven.
    assert angle(robot.pose(1)[1], start) < 0.5


# Robots -------------------------------------------------------------------------------------------

HELD, OUT = (0.0, 0.0, 0.0), (0.1, 0.0, 0.1)
TURNS = (0.6, 0.0, 0.0), (0.0, 0.0, 0.6), (0.0, 0.6, 0.0)


def in_turn(ends, *, turns, step):
    """Both hands out, turned about one axis after the other, each until it ends."""
    begins = (0.3, *ends[:-1])
    points = [WayPoint(at=0.2, left_hand=HELD, right_hand=HELD, left_turn=HELD, right_turn=HELD)]
    for begin, end, turn in zip(begins, ends, TURNS, strict=True):
        for at in (begin + 0.5, end):
            also = {"left_turn": turn, "right_turn": turn}
            points.append(WayPoint(at=at, left_hand=OUT, right_hand=OUT, **also))
    if not turns:
        points = [replace(point, left_turn=None, right_turn=None) for point in points]
    if step:
        lifted = up_and_down(lift=0.45, lower=2.85)
        points += [replace(point, at=point.at + 0.001) for point in lifted]
    return device_of(*sorted(points, key=lambda point: point.at))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "step", "most"),
    [("g1", False, 6), ("g1", True, 6), ("humanoid33", True, 6), ("talos", False, 4)],
)
def test_robots_turn_their_hands_and_keep_their_balance(get_robot, name, step, most, tmp_path):
    robot, path = get_robot(name), tmp_path / "turns.mcap"
    plant, off = TORQUE_TELEOP_PLANT.with_noise(), []
    # One of TALOS' wrists comes to its limit at once, and the arm takes its time from there on.
    ends = (1.5, 2.7, 4.2) if step else (3.0, 4.2, 5.8)
    for turns in (False, True) if step else (True,):
        device = in_turn(ends, turns=turns, step=step)
        run = run_teleop(robot, device, plant, duration=ends[-1], seed=4, recording=path)
        assert not run.fell
        assert run.log.tilt.max() < 0.1
        error = run.record["com"][:, :2] - run.record["zmp_reference"]
        off.append(np.sqrt(np.mean(error**2)))
    assert off[-1] < off[0] + 0.001 if step else off[0] < 0.02
    dynamics = Dynamics(robot)

    def rotations(time):
        dynamics.update(RobotState(run.log.q[round(time / DT)], np.zeros(robot.nv)))
        torso, *hands = (
            dynamics.frame(robot.frame_id(frame)).rotation for frame in (robot.torso, *robot.hands)
        )
        return [torso.T @ hand for hand in hands]

    start, reached, bound = rotations(0.1), 0, 0.15 if step else 0.12
    for end, turn in zip(ends, TURNS, strict=True):
        time = end - 0.02
        for hand, (before, now) in enumerate(zip(start, rotations(time), strict=True)):
            away = angle(now, pin.exp3(np.array(turn)) @ before)
            said = [text for at, text in run.record.notes("hands") if at <= time][-1]
            assert away < bound or said.split(", ")[hand] == "TURNED"
            reached += away < bound
    assert reached >= most
    if name == "g1" and step:
        again = replay_teleop(path, robot)
        assert np.array_equal(again.log.command, run.log.command)
