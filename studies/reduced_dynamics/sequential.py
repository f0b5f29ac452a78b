"""`sequential_answer`: the paper's order, energy before the tasks of the unconstrained chain."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise.control import WholeBodyController
from poise.dynamics import Dynamics, Partitions, ReducedDynamics, RobotState
from poise.errors import PoiseError
from poise.hqp import HierarchicalProblem, Level, make_solver
from poise.robots import Robot
from poise.stack import Stack, Task


class SequentialAnswer(NamedTuple):
    """What the two problems of the paper decide one after the other.

    Attributes:
        acceleration: dv [m/s^2, rad/s^2].
        torque: of the joints, with the exact rows of the unconstrained chain [N m].
        wrench: of the contacts in the order of the stack, zero of inactive ones [N, N m].
        missing: largest residual of a task of the unconstrained chain [m/s^2, rad/s^2].
    """

    acceleration: Float64[np.ndarray, " nv"]
    torque: Float64[np.ndarray, " nj"]
    wrench: Float64[np.ndarray, " nf"]
    missing: float


class Sequential:
    """LQP 1, blind for the tasks of the unconstrained chain, then LQP 2 under its centroid.

    LQP 1 as (28) has it: contacts, balance and the acceleration energy with that of the centroids.
    What it decides equals what the whole problem without the other tasks decides, so that this is
    what is solved here. Then LQP 2, (29): the centroid (30), the tasks, the energy. Limits of the
    unconstrained chain are left out of LQP 2.

    Args:
        robot: the robot.
        stack: contacts and levels of a walk; the first level is LQP 1's, the others LQP 2's. Tasks
            and contacts are shared with it, and led by whoever leads it.
    """

    def __init__(self, robot: Robot, stack: Stack) -> None:
        self._robot, self._stack = robot, stack
        self._first = WholeBodyController(robot, Stack(stack.contacts, stack.levels[:1]))
        self._tasks = [task for level in stack.levels[1:] for task in level]
        self._partitions, self._dynamics = Partitions(robot), Dynamics(robot)
        self._reduced: dict[tuple[str, ...], ReducedDynamics] = {}
        self._solver = make_solver("direct", None)

    def step(self, state: RobotState) -> SequentialAnswer:
        """The answer for a state; targets and loads are set beforehand.

        Raises:
            PoiseError: one of the two cannot be solved.
        """
        command = self._first.step(state)
        if not command.status.ok or command.acceleration is None or command.torque is None:
            raise PoiseError("LQP 1 has no answer", got=command.status.value)
        self._dynamics.update(state)
        active = [c for c in self._stack.contacts if c.active]
        reduced = self._reduced_of(tuple(c.frame for c in active))
        reduced.update(self._dynamics)
        part, dv = reduced.partition, command.acceleration
        dv_a, z = np.split(reduced.reduce(dv), [part.na])
        held = {c.frame for c in active}
        tasks = [t for t in self._tasks if getattr(t, "frame", "") not in held]
        dv_u, missing = self._second(reduced, tasks, dv_a, z)
        torque = command.torque.copy()
        base = self._robot.base_dofs
        torque[part.u.index - base] = reduced.torques_u(dv_a, dv_u)
        wrenches = [command.wrenches.get(c.name, np.zeros(c.dim)) for c in self._stack.contacts]
        return SequentialAnswer(part.merge(dv_a, dv_u), torque, np.concatenate(wrenches), missing)

    def _reduced_of(self, frames: tuple[str, ...]) -> ReducedDynamics:
        if frames not in self._reduced:
            self._reduced[frames] = ReducedDynamics(self._robot, self._partitions.of(frames))
        return self._reduced[frames]

    def _second(
        self,
        reduced: ReducedDynamics,
        tasks: list[Task],
        dv_a: Float64[np.ndarray, " na"],
        z: Float64[np.ndarray, " nz"],
    ) -> tuple[Float64[np.ndarray, " nu"], float]:
        """LQP 2: the unconstrained chain's acceleration and what its tasks miss at most."""
        part = reduced.partition
        for task in tasks:
            task.evaluate(self._dynamics)
        J = np.vstack([task.jacobian for task in tasks])
        wanted = np.concatenate([task.reference - task.drift for task in tasks])
        wanted -= J[:, part.a.index] @ dv_a
        J_u = J[:, part.u.index]
        problem = HierarchicalProblem(
            [
                Level(A=reduced.J_z.copy(), lower=z.copy(), upper=z.copy()),
                Level(A=J_u, lower=wanted, upper=wanted),
            ],
            H=0.5 * (reduced.M_uu + reduced.M_uu.T),
        )
        solution = self._solver.solve(problem)
        if not solution.ok:
            raise PoiseError("LQP 2 has no answer", got=solution.status.value)
        return solution.x.copy(), float(np.abs(J_u @ solution.x - wanted).max())
