"""`EverythingOperator`: feet, hands, head, body and stick, all of them at random.

`everything_section`: robots that it leads.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from msgspec.structs import replace

from poise.apps.teleoperation import BadOperator
from poise.dynamics import Dynamics, RobotState
from poise.locomotion import (
    BodyCommand,
    HandLeader,
    HandStatus,
    OperatorSample,
    StepTeleoperator,
    TrackedPose,
)
from poise.robots import Robot
from studies.plan import StudyOptions
from studies.staged import Outcome, episode, run_staged
from studies.trial_section import Case, TrialSection, median, none, total, worst

FASTEST = 1.0
"""Of the devices [m/s]."""

BEGINS = 1.0
"""When the hands begin [s]."""


class RandomHands:
    """An operator who sends both hands to places at random, and lets go now and then.

    Each device is moved straight at the place that its hand shall go to, at a speed drawn for each
    place; at the edge of reach another place is drawn. Every few seconds the clutch is open for
    0.3 s, and the device is meanwhile brought somewhere else.
    """

    def __init__(self, leader: HandLeader, size: float, dt: float, seed: int) -> None:
        self._leader, self._size, self._dt = leader, size, dt
        self._rng = np.random.default_rng((seed, 11))
        self._middle = [place.copy() for place in leader.places]
        count = len(self._middle)
        self._devices = [np.zeros(3) for _ in range(count)]
        self._goals = [place.copy() for place in self._middle]
        self._speeds, self._until = [FASTEST] * count, [0.0] * count
        self._open_at, self._stuck = [BEGINS] * count, [0.0] * count

    def hands(self, time: float) -> tuple[TrackedPose | None, TrackedPose | None]:
        """Samples of both devices; drawn tick by tick, so ask once a tick."""
        left, right = (self._hand(hand, time) for hand in (0, 1))
        return left, right

    def _hand(self, hand: int, time: float) -> TrackedPose:
        if time >= self._open_at[hand] + 0.3:
            self._open_at[hand] = time + float(self._rng.uniform(3.0, 8.0))
            self._devices[hand] = self._rng.uniform(-1.0, 1.0, 3)
        if time < BEGINS or time >= self._open_at[hand]:
            return TrackedPose.of(self._devices[hand], clutch=False)
        edge = self._leader.status[hand] is HandStatus.REACH
        self._stuck[hand] = self._stuck[hand] + self._dt if edge else 0.0
        way = self._goals[hand] - self._leader.places[hand]
        far = float(np.linalg.norm(way))
        if far < 0.02 or self._stuck[hand] > 0.3 or time >= self._until[hand]:
            self._draw(hand, time)
        step = min(1.0, self._dt * self._speeds[hand] / max(far, 1e-9))
        self._devices[hand] = self._devices[hand] + step * way
        return TrackedPose.of(self._devices[hand], clutch=True)

    def _draw(self, hand: int, time: float) -> None:
        """A place in a box that is larger than what the hand reaches."""
        box = self._size * self._rng.uniform((-0.6, -1.0, -0.5), (1.0, 1.0, 1.4))
        self._goals[hand] = self._middle[hand] + box
        self._speeds[hand] = float(self._rng.uniform(0.3, 1.0)) * FASTEST
        self._until[hand], self._stuck[hand] = time + 3.0, 0.0


def arm_length(robot: Robot) -> float:
    """Length of an arm, from a robot's height [m]: arms are long as legs are, about."""
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(robot.q_home, np.zeros(robot.nv)))
    return 0.6 * float(dynamics.com[2])


_LOOKS_FROM = 0.3
"""When the head takes hold [s]: its clutch has to be seen open first."""

_PAUSE, _WALKS = (0.5, 2.0), (0.5, 3.0)
"""From one whim to the next, and how long the stick is pushed [s]."""

_LOW = np.array([-0.1, -0.4, -0.4, -0.4, -0.5, -0.5])
_HIGH = np.array([0.05, 0.4, 0.4, 0.4, 0.5, 0.5])
_RATES = np.array([0.1, 0.6, 0.6, 0.6, 0.6, 0.6])
"""Of the body's height, the torso and both feet: what is asked for at least, at most [m, rad], and
how fast it changes [m/s, rad/s]."""

_BACK, _AHEAD = np.array([-0.3, -0.2, -0.5]), np.array([0.4, 0.2, 0.5])
"""What the stick asks for at most: ahead, to the left [m/s], turning to the left [rad/s]."""

_TURN = 0.6
"""Of the head about each axis, at most [rad]."""


class EverythingOperator:
    """The bad operator's feet and random hands, and a whim every half second to two.

    Of four whims one bends the body and turns the feet, one sets it straight, one pushes the stick
    every other time, and one turns the head.
    """

    def __init__(self, teleoperator: StepTeleoperator, seed: int) -> None:
        arm, dt = arm_length(teleoperator.robot), teleoperator.dt
        self._feet = BadOperator(teleoperator, seed)
        self._hands = RandomHands(teleoperator.hands, arm, dt, seed)
        self._rng = np.random.default_rng((seed, 77))
        self._body, self._goal = np.zeros(6), np.zeros(6)
        self._head, self._stick = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3)
        self._next, self._walks_until, self._last = 1.0, 0.0, 0.0

    def sample(self, time: float) -> OperatorSample | None:
        """What all of it says; drawn tick by tick, so ask once a tick."""
        if time >= self._next:
            self._next = time + float(self._rng.uniform(*_PAUSE))
            self._draw(time)
        change = (time - self._last) * _RATES
        self._body = self._body + np.clip(self._goal - self._body, -change, change)
        self._last = time
        feet, hands = self._feet.sample(time), self._hands.hands(time)
        if feet is None:
            return None
        height, roll, pitch, yaw, left, right = self._body.tolist()
        ahead, aside, turn = (self._stick if time < self._walks_until else np.zeros(3)).tolist()
        return replace(
            feet,
            hands=hands,
            head=TrackedPose(clutch=time > _LOOKS_FROM, orientation=self._head.tolist()),
            body=BodyCommand(height, (roll, pitch, yaw), (left, right)),
            velocity=(ahead, aside, turn),
        )

    def _draw(self, time: float) -> None:
        rng = self._rng
        whim = int(rng.integers(4))
        if whim == 0:
            self._goal = rng.uniform(_LOW, _HIGH)
        elif whim == 1:
            self._goal = np.zeros(6)
        elif whim == 2 and rng.random() < 0.5:
            self._walks_until = time + float(rng.uniform(*_WALKS))
            self._stick = rng.uniform(_BACK, _AHEAD)
        elif whim == 3:
            self._head = _quaternion(rng.uniform(-_TURN, _TURN, 3))


def _quaternion(turn: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "4"]:
    """A unit quaternion (x, y, z, w) of a rotation vector [rad]."""
    angle = max(float(np.linalg.norm(turn)), 1e-9)
    return np.array([*(math.sin(0.5 * angle) / angle * turn), math.cos(0.5 * angle)])


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One run under the operator."""

    robot: str  # its name
    condition: str  # a case of the campaign of bad operators
    seed: int  # of everything random
    seconds: float  # length unless the robot falls [s]


DESCRIBED, MIXED = "as described", "all of them"


def run_trial(trial: Trial) -> Outcome:
    """Run a trial."""
    scenario = episode(
        "bad_operators", trial.condition, trial.robot, trial.seed, seconds=trial.seconds
    )
    return run_staged(scenario, lambda leader: EverythingOperator(leader, trial.seed))


def _cases(options: StudyOptions) -> list[Case]:
    asked = [*((name, DESCRIBED) for name in ("biped20", "humanoid33", "g1", "talos"))]
    return [
        Case(
            name=f"{robot}, {condition}",
            trials=[
                Trial(
                    robot=robot,
                    condition=condition,
                    seed=options.first_seed + k,
                    seconds=15.0 if options.quick else 60.0,
                )
                for k in range(options.count(10, 1))
            ],
            allowed=none
            if condition == DESCRIBED
            else lambda found: sum(o.seconds for o in found) / 600.0,
        )
        for robot, condition in [*asked, ("g1", MIXED)]
    ]


everything_section = TrialSection(
    title="Everything at once",
    prose=(
        "Feet are the bad operator's, both hands go to places at random at up to 1 m/s, the head "
        "turns, the body is bent by up to 0.4 rad about each axis, lowered and raised, feet are "
        "turned, and the stick is pushed now and then. Asked: no fall as described, and at most "
        "one in ten minutes under all conditions of the campaign of bad operators.",
    ),
    run=run_trial,
    kind=Outcome,
    cases=_cases,
    columns={
        "minutes": total("seconds", 1.0 / 60.0),
        "feet lifted": total("steps"),
        "lean, median [rad]": median("tilt"),
        "most [rad]": worst("tilt"),
    },
)
"""The section."""
