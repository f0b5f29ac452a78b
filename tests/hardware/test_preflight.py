"""A simulated G1 in a hoist: all well, and with mistakes seeded between the link and the checks."""

import functools
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import poise
from poise.errors import ConfigurationError
from poise.hardware import LastCheck, LinkInfo, LinkStatus, MotorCommand, preflight
from poise.sim import PlantConfig

pytest.importorskip("mujoco")

from studies.g1_link._hanging import HangingRobot  # isort: skip
from studies.g1_link._mistakes import Mistaken, scaled, swapped, turned  # isort: skip

PERIOD = 0.008
"""Of the link: slower than a robot's, for the sake of the tests' time [s]."""

ABOUT_Z, MIRROR = pin.utils.rotate("z", np.pi / 2), np.diag([1.0, -1.0, 1.0])
UPSIDE_DOWN = pin.utils.rotate("x", np.pi)


@functools.cache
def check_of(robot):
    return LastCheck(robot, kp_max=100.0, kd_max=10.0)


class Replay:
    """A link that replays states at rest, and after each request for a motion those of it."""

    def __init__(self, link):
        self.info, self.status, self.refused, self.reason = link.info, LinkStatus.OK, 0, ""
        self.parts, self.link = {(): self.states(link, 2.1)}, link
        self.rest()

    @staticmethod
    def states(link, seconds):
        return [link.read() for _ in range(round(seconds / PERIOD))]

    def rest(self):
        """Begin anew, at rest."""
        self.play(self.parts[()])
        return self

    def play(self, states):
        self.now, self.last, self.over = iter(states), states[0], 0.0

    def ask(self, move):
        if (move.joints, move.sign) not in self.parts:
            self.link.ask(move)
            states = self.states(self.link, 0.8 if move.joints else 6.0)
            self.parts[move.joints, move.sign] = states
        self.play(self.parts[move.joints, move.sign])

    def read(self):
        state = next(self.now, None)
        self.over += state is None
        self.last = self.last if state is None else state
        return self.last

    def clock(self):
        return self.last.time + self.over

    def write(self, command):
        raise AssertionError("a preflight sends nothing")

    def close(self):
        pass


@pytest.fixture(scope="module")
def robot(get_robot):
    return get_robot("g1")


@pytest.fixture(scope="module")
def replay(robot):
    return Replay(HangingRobot(robot, check_of(robot), period=PERIOD))


def run(robot, replay, *, change=lambda state: state, motion=True, start=None, check=None, **link):
    """Preflight with a mistake."""
    return preflight(
        robot,
        Mistaken(replay.rest(), change, **link),
        check or check_of(robot),
        start=start,
        seconds=2.0,
        motion=replay.ask if motion else None,
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_robot_without_mistakes_passes(robot, seed):
    link = HangingRobot(robot, check_of(robot), seed=seed, period=PERIOD)
    found = preflight(robot, link, check_of(robot), motion=link.ask)
    assert found.ok, str(found)
    names = [check.name for check in found.checks]
    assert len(set(names)) == len(names) >= 20
    unseen = [check.name for check in found.checks if check.ok is None]
    assert unseen == ["round trip", "temperature", "battery"]


def test_what_a_link_measures_besides_is_checked(robot, replay):
    warm = at_joints(robot, "temperature", 40.0)
    q = replay.parts[()][0].q
    known = {"start": q, "round_trip": 2e-3, "battery": (50.0, 43.0)}
    found = run(robot, replay, change=warm, motion=False, **known)
    assert found.ok, str(found)
    assert all(check.ok for check in found.checks)


def at_joints(robot, name, value):
    return lambda state: replace(state, **{name: np.full(robot.nj, value)})


def index(robot, name):
    return robot.joint_index(f"{name}_joint")


def by_joints(make, *names, **settings):
    """Settings of a run whose mistake is one of these joints."""
    arguments = settings.pop("arguments", ())
    return lambda robot: {
        "change": make(*(index(robot, name) for name in names), *arguments, **settings)
    }


def always(**settings):
    return lambda robot: settings


def stamped(stamp):
    return always(change=lambda state: replace(state, time=stamp(state.time)))


def late(state):
    """The same state arrives up to six periods late."""
    delay = np.random.default_rng(round(1e4 * state.time)).uniform(0.0, 6.0 * PERIOD)
    return replace(state, arrived=state.time + delay)


def wider(robot):
    limits = type("Limits", (), {n: getattr(robot, n) for n in ("joint_names", "v_max", "tau_max")})
    limits.q_min, limits.q_max = robot.q_min, robot.q_max.copy()
    limits.q_max[3] += 0.1
    return {"check": LastCheck(limits, kp_max=100.0, kd_max=10.0)}


def other_robot(robot):
    """A G1 whose waist has one joint."""
    names = [n for n in robot.joint_names if n not in ("waist_roll_joint", "waist_pitch_joint")]
    return {"info": LinkInfo(name="g1", rate=1.0 / PERIOD, joints=tuple(names))}


AT_REST = {
    "elbow and shoulder roll interchanged": (
        "gravity torques",
        by_joints(swapped, "left_elbow", "left_shoulder_roll"),
    ),
    "elbow and the other side's knee interchanged": (
        "gravity torques",
        by_joints(swapped, "left_elbow", "right_knee"),
    ),
    "sign of an elbow": ("position limits", by_joints(scaled, "left_elbow", arguments=(-1.0,))),
    "a knee in degrees": ("position limits", by_joints(scaled, "left_knee", arguments=(57.3,))),
    "a motor that is missing": ("joints heard", by_joints(scaled, "left_knee", arguments=(0.0,))),
    "a motor that repeats itself": (
        "joints heard",
        by_joints(scaled, "left_knee", arguments=(0.0, 0.1)),
    ),
    "NaN": ("numbers", by_joints(scaled, "right_elbow", arguments=(np.nan,))),
    "another robot": ("joints", other_robot),
    "a lost link": ("link", always(status=LinkStatus.LOST)),
    "unit upside down": (
        "upright",
        always(change=turned(UPSIDE_DOWN, "gyro", "acceleration", "quaternion")),
    ),
    "quaternion with w first": (
        "upright",
        always(change=lambda s: replace(s, quaternion=s.quaternion[[3, 0, 1, 2]])),
    ),
    "accelerometer on its side": (
        "accelerometer",
        always(change=turned(pin.utils.rotate("x", np.pi / 2), "acceleration")),
    ),
    "accelerometer in g": ("gravity", always(change=turned(np.eye(3) / 9.81, "acceleration"))),
    "half the rate": ("rate", always(fresh=lambda time: round(time / PERIOD) % 2 == 0)),
    "late arrivals": ("arrivals", always(change=late)),
    "gaps": ("gaps", always(fresh=lambda time: time % 0.5 > 5 * PERIOD)),
    "stamps that stand": ("clock", stamped(lambda time: float(np.floor(time)))),
    "stamps that go back": ("clock", stamped(lambda time: time - 0.1 * np.floor(time))),
    "stamps in milliseconds": ("clock", stamped(lambda time: 1e3 * time)),
    "slow stamps": ("clock", stamped(lambda time: 0.9 * time)),
    "a clock that stands": ("clock", always(clock=lambda: 7.0)),
    "a hot motor": ("temperature", lambda robot: {"change": at_joints(robot, "temperature", 85.0)}),
    "a low battery": ("battery", always(battery=(41.0, 43.0))),
    "a slow network": ("round trip", always(round_trip=0.2)),
    "another posture": ("start posture", lambda robot: {"start": robot.q_home[7:] + 1.5}),
    "limits wider than the robot's": ("last check", wider),
}
"""The check that has to find a mistake of a robot at rest, and the mistake."""

IN_MOTION = {
    "knees interchanged": ("moves", by_joints(swapped, "left_knee", "right_knee")),
    "hips interchanged": ("moves", by_joints(swapped, "left_hip_yaw", "right_hip_yaw")),
    "hip and wrist interchanged": ("moves", by_joints(swapped, "left_hip_roll", "right_wrist_yaw")),
    "an encoder that stands": (
        "encoders",
        by_joints(scaled, "right_hip_roll", arguments=(0.0,), names=("q",)),
    ),
    "velocities interchanged": (
        "encoders",
        by_joints(swapped, "left_hip_pitch", "left_wrist_roll", names=("dq",)),
    ),
    "sign of a velocity": (
        "encoders",
        by_joints(scaled, "left_wrist_yaw", arguments=(-1.0,), names=("dq",)),
    ),
    "a velocity in turns": (
        "encoders",
        by_joints(scaled, "left_ankle_roll", arguments=(0.159,), names=("dq",)),
    ),
    "sign of a torque": (
        "torque signs",
        by_joints(scaled, "left_hip_yaw", arguments=(-1.0,), names=("tau",)),
    ),
    "gyro turned": ("gyro", always(change=turned(ABOUT_Z, "gyro"))),
    "gyro mirrored": ("gyro", always(change=turned(MIRROR, "gyro"))),
    "accelerometer turned": ("accelerometer axes", always(change=turned(ABOUT_Z, "acceleration"))),
    "accelerometer mirrored": ("accelerometer axes", always(change=turned(MIRROR, "acceleration"))),
}
"""The same of one that is moved; at rest it passes."""


@pytest.mark.parametrize("name", AT_REST)
def test_a_mistake_is_found_at_rest(robot, replay, name):
    check, settings = AT_REST[name]
    found = run(robot, replay, motion=False, **settings(robot))
    assert check in found.failed, str(found)
    assert not found.ok
    assert next(c.remedy for c in found.checks if c.name == check) in str(found)


@pytest.mark.parametrize("name", IN_MOTION)
def test_a_mistake_is_found_by_a_small_motion_alone(robot, replay, name):
    check, settings = IN_MOTION[name]
    assert run(robot, replay, motion=False, **settings(robot)).ok
    found = run(robot, replay, **settings(robot))
    assert check in found.failed, str(found)


def test_nobody_is_asked_to_move_a_robot_that_failed_at_rest(robot, replay):
    def ask(move):
        raise AssertionError(move.prompt)

    link = Mistaken(replay.rest(), battery=(41.0, 43.0))
    found = preflight(robot, link, check_of(robot), seconds=2.0, motion=ask)
    assert found.failed == ("battery",)


HOLD = np.zeros(29)
HOLD[[15, 22]], HOLD[[18, 25]] = -1.4, 1.4  # shoulder pitch and elbow: straight arms in front


@pytest.mark.parametrize(("mass", "passes"), [(1.0, True), (1.5, False)])
def test_masses_show_where_motors_hold_limbs(robot, mass, passes):
    limits = robot.tau_max
    zero = np.zeros(robot.nj)
    hold = MotorCommand(q=HOLD, dq=zero, kp=3.0 * limits, kd=0.04 * limits, tau=zero)
    config = PlantConfig(mass_scale=mass, joint_friction=0.2, control_dt=0.004).with_noise()
    check = LastCheck(robot, kp_max=1000.0, kd_max=20.0)
    link = HangingRobot(robot, check, hold=hold, config=config)
    found = preflight(robot, link, check, seconds=1.0)
    assert found.failed == (() if passes else ("gravity torques",)), str(found)


@pytest.mark.slow
def test_each_joint_by_itself_shows_order_and_sign_within_a_limb(robot):
    replay = Replay(HangingRobot(robot, check_of(robot), period=PERIOD))
    pairs = ("left_hip_roll", "left_hip_yaw"), ("left_ankle_pitch", "left_ankle_roll")
    pairs += (("right_wrist_pitch", "right_wrist_yaw"), ("left_hip_pitch", "left_knee"))
    changes = [swapped(*(index(robot, name) for name in pair)) for pair in pairs]
    flips = "left_hip_yaw", "right_ankle_roll", "right_wrist_roll", "waist_yaw", "waist_roll"
    changes += [scaled(index(robot, name), -1.0) for name in flips]
    for change in (None, *changes):
        link = replay.rest() if change is None else Mistaken(replay.rest(), change)
        found = preflight(
            robot, link, check_of(robot), seconds=2.0, motion=replay.ask, each_joint=True
        )
        assert found.failed == (() if change is None else ("moves",)), str(found)


WAYS = {"forward": (0, 1), "backward": (0, -1), "to the left": (1, 1), "to the right": (1, -1)}
WAYS |= {"up": (2, 1), "down": (2, -1)}


def test_requests_name_the_way_that_the_simulator_moves(robot, replay):
    """MuJoCo's own kinematics: the CoM of what the joint moves goes where the words say."""
    moves, plant = [], poise.Plant(robot)
    states = replay.parts[()][-2:]
    state = states[0]

    def ask(move):
        moves.append(move)
        replay.play(states)

    found = preflight(
        robot, replay.rest(), check_of(robot), seconds=2.0, motion=ask, each_joint=True
    )
    told = 0
    for move in moves[1:]:
        k = move.joints[0]
        body = plant.model.joint(robot.joint_names[k]).bodyid[0]
        places = []
        for step in (0.0, 1e-3 * move.sign):
            q = robot.q_home.copy()
            q[2], q[7:] = 2.0, state.q
            q[7 + k] += step
            plant.reset(q)
            places.append(plant.data.subtree_com[body].copy())
        path = places[1] - places[0]
        for way, (axis, sign) in WAYS.items():
            if move.prompt.endswith(f"its far end goes {way}."):
                assert sign * path[axis] == pytest.approx(np.abs(path).max()), move.prompt
                told += 1
    assert [move.joints[0] for move in moves[1:]] == list(range(robot.nj)), str(found)
    assert told > 15


@pytest.mark.parametrize(
    "settings", [{"seconds": 0.0}, {"seconds": np.nan}, {"start": np.zeros(3)}]
)
def test_settings_that_cannot_be_are_refused(robot, replay, settings):
    with pytest.raises(ConfigurationError, match="got"):
        preflight(robot, replay, check_of(robot), **settings)
