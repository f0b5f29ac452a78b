"""`run_reference_trial`: random references for a standing robot, feasible and absurd."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.control import WholeBodyController
from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, rollout
from poise.stack import BalanceLimit, ComTask, FrameTask, Stack, default_stack
from studies.locomotion.late_estimate import PERIOD, LateEstimate, typical_sensors

_FARTHEST, _WIDEST = 0.5, 1.5
"""How far references go from where the robot is [m, rad]."""

_SLOWEST, _FASTEST = 0.2, 3.0
"""Frequencies of references that move [Hz]."""

_LATEST = 2.5
"""Until when references begin [s]."""


@dataclass(frozen=True, kw_only=True)
class ReferenceTrial:
    """What a worker is asked for.

    Attributes:
        robot: its name.
        seed: of the references.
        strategy: "direct" or "weighted".
        limited: whether the stack has its balance limit.
        seconds: how long [s].
    """

    robot: str
    seed: int
    strategy: str = "direct"
    limited: bool = True
    seconds: float = 5.0


@dataclass(frozen=True, kw_only=True)
class ReferenceOutcome:
    """What became of it.

    Attributes:
        trial: the trial.
        fell: whether the robot fell.
        time: how long it ran [s].
        asked: what moved or jumped, in words.
        held: part of the ticks in which the balance limit held it back, and said so.
        torque_step: largest change of a torque from tick to tick, by its limit.
        worst_physics: largest residual of contacts and joint limits.
    """

    trial: ReferenceTrial
    fell: bool
    time: float
    asked: str
    held: float
    torque_step: float
    worst_physics: float


def run_reference_trial(trial: ReferenceTrial) -> ReferenceOutcome:
    """Stands on the estimate, and is asked for things."""
    robot = load_robot(trial.robot)
    config = PlantConfig(control_dt=PERIOD, sensors=typical_sensors())
    plant = Plant(robot, config, seed=trial.seed)
    plain = default_stack(robot)
    stack = Stack(
        plain.contacts,
        plain.levels,
        torque_limit=plain.torque_limit,
        balance_limit=BalanceLimit(enabled=trial.limited),
    )
    controller = WholeBodyController(robot, stack, strategy=trial.strategy)
    leader = RandomReferences(robot, stack, trial.seed)
    last: Float64[np.ndarray, " nj"] | None = None
    held = ticks = 0
    step = worst = 0.0
    estimate = LateEstimate(robot)
    for tick in rollout(plant, controller, leader, estimator=estimate, duration=trial.seconds):
        ticks += 1
        held += tick.command.held_back
        torque = tick.command.torque
        if torque is not None:
            if last is not None:
                step = max(step, float((np.abs(torque - last) / robot.tau_max).max()))
            last = torque.copy()
        if len(tick.command.residuals) > 1:
            worst = max(worst, tick.command.residuals[1])
    return ReferenceOutcome(
        trial=trial,
        fell=plant.fallen,
        time=plant.time,
        asked="; ".join(leader.asked),
        held=held / max(ticks, 1),
        torque_step=step,
        worst_physics=worst,
    )


class RandomReferences:
    """A leader that asks for anything.

    Of COM, pelvis, torso and hands some are asked for something, the others hold. What is asked for
    begins at a random time, goes up to half a metre and 1.5 rad in a random direction, and jumps
    there, or swings around.

    Args:
        robot: the robot.
        stack: its tasks.
        seed: of what is drawn.

    Attributes:
        stack: its tasks.
        asked: what, in words.
    """

    def __init__(self, robot: Robot, stack: Stack, seed: int) -> None:
        self.stack, self.asked = stack, list[str]()
        random = np.random.default_rng(seed)
        dynamics = Dynamics(robot)
        dynamics.update(RobotState(robot.q_home, np.zeros(robot.nv)))
        tasks = [t for _, t in stack.tasks() if isinstance(t, ComTask | FrameTask)]
        chosen = random.random(len(tasks)) < 0.5
        chosen[random.integers(len(tasks))] = True
        self._moves: list[_Move] = []
        for task, taken in zip(tasks, chosen, strict=True):
            move = _Move(task, dynamics, robot, random)
            if taken:
                self._moves.append(move)
                self.asked.append(move.describe())

    def lead(self, state: RobotState) -> None:
        """Asks."""
        for move in self._moves:
            move.lead(state.time)


class _Move:
    """What one task is asked for."""

    def __init__(
        self,
        task: ComTask | FrameTask,
        dynamics: Dynamics,
        robot: Robot,
        random: np.random.Generator,
    ) -> None:
        self._task = task
        if isinstance(task, FrameTask):
            place, rotation = dynamics.placement(robot.frame_id(task.frame))
            self._place, self._rotation = place.copy(), rotation.copy()
        else:
            self._place, self._rotation = dynamics.com.copy(), np.eye(3)
        self._begin = float(random.uniform(0.3, _LATEST))
        self._by = _direction(random) * float(random.uniform(0.0, _FARTHEST))
        self._turn = _direction(random) * float(random.uniform(0.0, _WIDEST))
        self._jumps = bool(random.random() < 0.5)
        self._rate = float(2.0 * np.pi * random.uniform(_SLOWEST, _FASTEST))

    def describe(self) -> str:
        """In words."""
        how = "jumps" if self._jumps else f"swings at {self._rate / (2.0 * np.pi):.1f} Hz"
        by = ", ".join(f"{x:.2f}" for x in self._by)
        angle = float(np.linalg.norm(self._turn))
        return f"{self._task.name} {how} by ({by}) m, {angle:.2f} rad at {self._begin:.1f} s"

    def lead(self, time: float) -> None:
        """Asks, once it is time."""
        since = time - self._begin
        if since < 0.0:
            return
        w = self._rate
        far, rate, second = 1.0, 0.0, 0.0
        if not self._jumps:
            far, rate, second = np.sin(w * since), w * np.cos(w * since), -w * w * np.sin(w * since)
        place = self._place + far * self._by
        if isinstance(self._task, ComTask):
            self._task.set_target(place, rate * self._by, second * self._by)
            return
        twist = np.concatenate((self._by, self._turn))
        rotation = pin.exp3(far * self._turn) @ self._rotation
        position = place if self._task.unit != "rad" else None
        self._task.set_target(position, rotation, rate * twist, second * twist)


def _direction(random: np.random.Generator) -> Float64[np.ndarray, "3"]:
    vector = random.normal(size=3)
    return vector / np.linalg.norm(vector)
