"""A moving run on a fixed base, and what each tick's bias formulas start from.

`BiasMotion`: its tasks and targets. `Cubic`: the paper's smooth motion from one value to another.
"""

import math
from dataclasses import dataclass
from functools import reduce

import numpy as np

from benchmarks.bias.formulas import BiasTick
from benchmarks.bias.recursion import PaperRecursion
from benchmarks.bias.rows import PaperFormulation
from benchmarks.rigid_plant import EARTH, RigidPlant, with_gravity
from poise.control import OperationalSpaceController, RankTreatment
from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot
from poise.sim import rollout
from poise.stack import FrameTask, JointTask, Stack, Task

DURATION = 0.55
"""Length of the motion [s]."""

_TURN = float(np.deg2rad(15.0))
"""How far the first joint of the torso turns [rad]."""

_KP = 100.0
"""Stiffness of all tasks, critically damped [1/s^2]."""


@dataclass(frozen=True, kw_only=True)
class Cubic:
    """A cubic polynomial from rest to rest: displacement (3 r^2 - 2 r^3) with r = t / duration.

    Its acceleration jumps at both ends.
    """

    displacement: float  # how far [unit]
    duration: float  # how long [s]

    def at(self, time: float) -> tuple[float, float, float]:
        """Value, rate [unit/s] and second rate [unit/s^2] at a time [s]; still after the end."""
        if time >= self.duration:
            return self.displacement, 0.0, 0.0
        r, T = time / self.duration, self.duration
        return (
            self.displacement * r * r * (3.0 - 2.0 * r),
            6.0 * self.displacement * r * (1.0 - r) / T,
            6.0 * self.displacement * (1.0 - 2.0 * r) / T**2,
        )


class BiasMotion:
    """A stack with one task a level, and its moving target.

    It is the second study of (Park, Jin, Kang 2022): the first joint of the torso turns by 15
    degrees while its other joints are held (task 1), and each hand keeps its pose (tasks 2 and 3),
    as if they held a tray. It starts in the home posture.
    """

    def __init__(self, robot: Robot) -> None:
        home, torso = Dynamics(robot), _shared_joints(robot)
        self._way = Cubic(displacement=_TURN, duration=DURATION)
        self._start = robot.q_home[[robot.joint_index(name) for name in torso]]
        self._moving = JointTask(torso, kp=_KP, name="torso")
        tasks: list[Task] = [self._moving]
        for hand in robot.hands:
            place = home.frame(robot.frame_id(hand))
            task = FrameTask(hand, kp=_KP)
            task.set_target(position=place.position.copy(), rotation=place.rotation.copy())
            tasks.append(task)
        # The tasks, bound to the robot
        self.stack = Stack([], [[task] for task in tasks], softening=0.0)
        self.stack.bind(robot)
        self.aim(0.0)

    def aim(self, time: float) -> None:
        """Set the moving target of a time [s]."""
        along = np.zeros(len(self._start))
        along[0] = 1.0
        value, rate, second = self._way.at(time)
        self._moving.set_target(
            position=self._start + value * along,
            velocity=rate * along,
            acceleration=second * along,
        )


def _shared_joints(robot: Robot) -> list[str]:
    """Joints that move every hand, from the base up."""
    model = robot.model
    chains = [
        set(model.supports[model.frames[robot.frame_id(hand)].parentJoint].tolist())
        for hand in robot.hands
    ]
    names = [model.names[joint] for joint in sorted(reduce(set[int].intersection, chains))]
    return [name for name in names if name in robot.joint_names]


RANK = RankTreatment(low=0.02, high=0.1)
"""The torso's five joints move each other so much that one combination of them has a singular value
of 0.16: low, but nothing is lost. Below the usual thresholds it would be let go in part."""


def record_motion(robot: Robot) -> tuple[RobotState, ...]:
    """Run the motion of `BiasMotion` under `OperationalSpaceController`; return a state a tick."""
    own = with_gravity(robot, EARTH)
    motion = BiasMotion(own)
    controller = OperationalSpaceController(own, motion.stack, rank=RANK, torque_step=math.inf)
    plant = RigidPlant(robot, robot.q_home.copy())
    ticks = rollout(plant, controller, lambda state: motion.aim(state.time), duration=DURATION)
    return tuple(tick.state for tick in ticks)


class BiasInputs:
    """Computes, state by state, what all formulas share."""

    def __init__(self, robot: Robot) -> None:
        self._motion = BiasMotion(robot)
        self._formulation = PaperFormulation(robot, self._motion.stack)
        self._dynamics = Dynamics(robot)
        self._recursion = PaperRecursion("proposed", RANK)
        self._before = [np.zeros(task.dim) for _, task in self._motion.stack.tasks()][1:]

    def of(self, state: RobotState) -> BiasTick:
        """The quantities of the next state, valid until the next."""
        dynamics, formulation = self._dynamics, self._formulation
        dynamics.update(state)
        self._motion.aim(state.time)
        formulation.fill(dynamics)
        rows = formulation.rows
        self._recursion.resolve(rows, dynamics)
        tasks = self._recursion.tasks[1:]
        references = [rows.reference[level] for level in rows.slices[1:]]
        references_p = [
            reference - bias
            for reference, bias in zip(references, self._recursion.bias[1:], strict=True)
        ]
        torques = [
            task.J_p.T @ (task.Lambda_p @ reference + task.mu_p)
            for task, reference in zip(tasks, references_p, strict=True)
        ]
        tick = BiasTick(
            tasks=tasks,
            references=references,
            references_p=references_p,
            torques_above=list(np.cumsum(torques, axis=0)[:-1]),
            M_inverse=np.linalg.inv(dynamics.M),
            h=dynamics.h,
            v=state.v,
            before=self._before,
        )
        self._before = [(task.J - task.J_p) @ state.v for task in tasks[1:]]
        return tick
