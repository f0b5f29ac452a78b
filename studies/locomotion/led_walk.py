"""`run_led`: a walk by commanded velocities on the estimate of the base, on a course, pushed."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.control import Command, WholeBodyController
from poise.dynamics import RobotState
from poise.estimation import EstimatorConfig
from poise.locomotion import Walker, walking_stack
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, SensorConfig, rollout
from poise.stack import Stack, SurfaceContact, TorqueLimit
from studies.locomotion.courses import Course, Velocity, make_course
from studies.locomotion.late_estimate import PERIOD, LateEstimate, typical_sensors

PUSH_TIME = 0.08
"""Of every push on the torso [s]."""

_BEGIN, _STEADY = 1.0, 3.0
"""When a velocity is asked for, and from when on it counts [s]."""

_LARGE = 0.5
"""Changes of a torque above this, by its limit, are counted."""


@dataclass(frozen=True, kw_only=True)
class LedTrial:
    """What a worker is asked for.

    Attributes:
        robot: its name.
        seed: of noise, biases, and random commands.
        seconds: how long [s].
        velocity: asked for; at random, another every few seconds, when None.
        course: what it walks on, of `COURSES`, which then says length and velocities, too.
        push: change of the robot's velocity [m/s]; 0 for none.
        direction: of the push, from ahead to the left [rad].
        at: when the push begins [s].
        bounded: whether the change of torques is, as it is in the stack that walks.
    """

    robot: str
    seed: int
    seconds: float
    velocity: Velocity | None = (0.0, 0.0, 0.0)
    course: str = ""
    push: float = 0.0
    direction: float = 0.0
    at: float = 0.0
    bounded: bool = True


@dataclass(frozen=True, kw_only=True)
class LedOutcome:
    """What became of a trial.

    Attributes:
        trial: the trial.
        fell: whether the robot fell.
        seconds: when the walk ended [s].
        rested: whether it stood still in the end, feet side by side.
        reached: mean velocity from `_STEADY` s on, as it was asked for.
        steps: how many steps it made.
        torque_step: largest change of a torque from tick to tick, by its limit.
        torque_steps: how many changes were larger than half a limit.
        worst_physics: largest residual of contacts and joint limits.
    """

    trial: LedTrial
    fell: bool
    seconds: float
    rested: bool
    reached: Velocity
    steps: int
    torque_step: float
    torque_steps: int
    worst_physics: float


class TorqueSteps:
    """Changes of torques from tick to tick.

    Args:
        robot: whose torques.

    Attributes:
        largest: largest change, by the joint's limit.
        large: number of changes of more than half a limit.
        worst_physics: largest residual of contacts and joint limits.
    """

    def __init__(self, robot: Robot) -> None:
        self.largest = self.worst_physics = 0.0
        self.large = 0
        self._limits = robot.tau_max
        self._last: Float64[np.ndarray, " nj"] | None = None

    def take(self, command: Command) -> None:
        """Take the next tick's command into account."""
        torque = command.torque
        if torque is not None and self._last is not None:
            change = np.abs(torque - self._last) / self._limits
            self.largest = max(self.largest, float(change.max()))
            self.large += int((change > _LARGE + 1e-9).sum())
        self._last = None if torque is None else torque.copy()
        self.worst_physics = max([self.worst_physics, *command.residuals[1:2]])


class _Leader:
    """Asks the walker for the velocities of a course."""

    def __init__(self, walker: Walker, stack: Stack, course: Course, seed: int) -> None:
        self.stack, self._walker, self._commands = stack, walker, list(course.commands)
        self._random = not course.commands
        self._rng = np.random.default_rng(seed)
        self._next = _BEGIN

    def lead(self, state: RobotState) -> None:
        """Sets what the next tick should do."""
        while self._commands and state.time >= self._commands[0][0]:
            self._walker.set_velocity(*self._commands.pop(0)[1])
        if self._random and state.time >= self._next:
            self._walker.set_velocity(*self._any_velocity())
        self._walker.lead(state)

    def _any_velocity(self) -> Velocity:
        self._next += self._rng.uniform(1.0, 4.0)
        if self._rng.random() < 0.2:
            return 0.0, 0.0, 0.0
        ahead, left, turn = self._rng.uniform((-0.4, -0.25, -0.6), (0.6, 0.25, 0.6)).tolist()
        return ahead, left, turn


def run_led(trial: LedTrial) -> LedOutcome:
    """Walks."""
    pushes = [(trial.at, trial.push, trial.direction)] if trial.push > 0.0 else []
    return walk_course(trial, _course(trial), pushes)


def walk_course(
    trial: LedTrial,
    course: Course,
    pushes: Sequence[tuple[float, float, float]],
    sensors: SensorConfig | None = None,
    fault: Callable[[RobotState], RobotState] | None = None,
) -> LedOutcome:
    """Walk a course with robot and seed of a trial, whose own course and push do not count.

    Args:
        trial: with robot, seed and whether torques are bounded.
        course: to be walked.
        pushes: when each begins [s], its change of velocity [m/s], and its direction [rad].
        sensors: of the robot; the typical ones, as late as the course says, when None.
        fault: changes what is measured.
    """
    robot = load_robot(trial.robot)
    config = PlantConfig(
        control_dt=PERIOD,
        sensors=sensors or typical_sensors(course.delay),
        friction=course.friction,
        blocks=course.blocks,
        mass_scale=course.mass,
    )
    plant = Plant(robot, config, seed=trial.seed)
    q = robot.q_home.copy()
    q[2] += course.height
    plant.reset(q)
    stack = _stack(robot, course, trial.bounded)
    walker = Walker(robot, stack, q=q)
    for at, speed, direction in pushes:
        force = robot.mass * speed / PUSH_TIME
        x, y = force * math.cos(direction), force * math.sin(direction)
        plant.push(robot.torso, (x, y, 0.0), PUSH_TIME, at)
    estimate = LateEstimate(
        robot,
        EstimatorConfig(ground=course.height),
        q_start=q,
        delay=course.delay,
        fault=fault,
    )
    poses: list[tuple[float, float, float]] = []
    changes = TorqueSteps(robot)
    ticks = rollout(
        plant,
        WholeBodyController(robot, stack),
        _Leader(walker, stack, course, trial.seed),
        estimator=estimate,
        duration=course.seconds,
    )
    for tick in ticks:
        changes.take(tick.command)
        if tick.time >= _STEADY:
            x, y, z, w = tick.truth.q[3:7].tolist()
            yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
            poses.append((*tick.truth.q[:2].tolist(), yaw))
        if plant.fallen:
            break
    return LedOutcome(
        trial=trial,
        fell=plant.fallen,
        seconds=plant.time,
        rested=walker.status.value == "standing",
        reached=_mean_velocity(np.array(poses)),
        steps=walker.steps_made,
        torque_step=changes.largest,
        torque_steps=changes.large,
        worst_physics=changes.worst_physics,
    )


def _course(trial: LedTrial) -> Course:
    """What a trial's robot walks on: flat ground unless it names a course."""
    if trial.course:
        return make_course(trial.course, trial.seed)
    commands = () if trial.velocity is None else ((_BEGIN, trial.velocity),)
    return Course(seconds=trial.seconds, commands=commands)


def _stack(robot: Robot, course: Course, bounded: bool) -> Stack:
    """The stack that walks, with the friction that it is told of."""
    plain = walking_stack(robot)
    limit = plain.torque_limit if bounded else TorqueLimit()
    contacts = plain.contacts
    if course.model_friction is not None:
        contacts = [SurfaceContact(sole, friction=course.model_friction) for sole in robot.soles]
    return Stack(contacts, plain.levels, torque_limit=limit, joint_limit=plain.joint_limit)


def _mean_velocity(poses: np.ndarray) -> Velocity:
    """Along the robot, from one tick to the next."""
    if len(poses) < 2:
        return 0.0, 0.0, 0.0
    moved, yaw = np.diff(poses[:, :2], axis=0), np.unwrap(poses[:, 2])
    c, s = np.cos(yaw[1:]), np.sin(yaw[1:])
    rate = 1.0 / (len(moved) * PERIOD)
    ahead = float(np.sum(c * moved[:, 0] + s * moved[:, 1])) * rate
    left = float(np.sum(c * moved[:, 1] - s * moved[:, 0])) * rate
    return ahead, left, float(yaw[-1] - yaw[0]) * rate
