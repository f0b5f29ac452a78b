"""`BiasRecording`: a moving run on a fixed base, and what each tick's bias formulas start from."""

import math

import numpy as np

from benchmarks.bias.formulas import BiasTick
from benchmarks.bias.motion import DURATION, TICKS, BiasMotion
from benchmarks.bias.rates import MatrixRates
from benchmarks.bias.recursion import PaperRecursion
from benchmarks.bias.rows import PaperFormulation
from benchmarks.recording import Progress
from benchmarks.rigid_plant import EARTH, RigidPlant, with_gravity
from poise.control import OperationalSpaceController, RankTreatment
from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot
from poise.sim import rollout

RANK = RankTreatment(low=0.02, high=0.1)
"""The torso's five joints move each other so much that one combination of them has a singular value
of 0.16: low, but nothing is lost. Below the usual thresholds it would be let go in part."""


def record_motion(robot: Robot, progress: Progress | None = None) -> tuple[RobotState, ...]:
    """Runs the motion in simulation under `OperationalSpaceController`.

    Args:
        robot: see `BiasMotion`.
        progress: told how far the run is.

    Returns:
        The states, one a tick.

    Raises:
        ConfigurationError: the robot cannot do the motion.
    """
    own = with_gravity(robot, EARTH)
    motion = BiasMotion(own)
    controller = OperationalSpaceController(own, motion.stack, rank=RANK, torque_step=math.inf)
    plant = RigidPlant(robot, robot.q_home.copy())
    states: list[RobotState] = []
    for tick in rollout(plant, controller, lambda state: motion.aim(state.time), duration=DURATION):
        states.append(tick.state)
        if progress is not None and len(states) % 50 == 0:
            progress(float(len(states)), float(TICKS))
    return tuple(states)


class BiasInputs:
    """Computes, state by state, what all formulas share.

    Args:
        robot: whose states.
    """

    def __init__(self, robot: Robot) -> None:
        self._motion = BiasMotion(robot)
        self._formulation = PaperFormulation(robot, self._motion.stack)
        self._dynamics, self._rates = Dynamics(robot), MatrixRates(robot)
        self._recursion = PaperRecursion("proposed", RANK)
        self._before = [np.zeros(task.dim) for _, task in self._motion.stack.tasks()][1:]

    def of(self, state: RobotState) -> BiasTick:
        """The quantities of the next state, exact derivatives among them; valid until the next.

        Args:
            state: the state.
        """
        dynamics, rates, formulation = self._dynamics, self._rates, self._formulation
        dynamics.update(state)
        rates.update(state)
        self._motion.aim(state.time)
        formulation.fill(dynamics, rates)
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
