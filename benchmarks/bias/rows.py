"""`PaperFormulation`: contacts and tasks of a stack as the rows that the paper's equations take."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot
from poise.stack import Contact, Stack, Task


class BackwardDifferences:
    """Backward differences over a tick, level by level; zero where there is no past."""

    def __init__(self) -> None:
        self._time: float | None = None
        self._before: list[np.ndarray] = []
        self._now: list[np.ndarray] = []
        self._dt = 0.0

    def begin(self, time: float) -> None:
        """Starts a new state at a time [s]."""
        self._before, self._now = self._now, []
        self._dt = 0.0 if self._time is None else time - self._time
        self._time = time

    def of(self, value: np.ndarray) -> np.ndarray:
        """Derivative of the next quantity; they must come in the same order every tick."""
        index = len(self._now)
        self._now.append(value)
        if self._dt <= 0.0 or index >= len(self._before):
            return np.zeros_like(value)
        return (value - self._before[index]) / self._dt


@dataclass(slots=True, eq=False)
class PaperRows:
    """Rows J_i dv + Jdot_i v = xdd_i,ref, the contacts first, then level by level."""

    jacobian: Float64[np.ndarray, "t nv"]  # J_i, stacked
    drift: Float64[np.ndarray, " t"]  # Jdot_i v, stacked
    reference: Float64[np.ndarray, " t"]  # xdd_i,ref, stacked
    # What a row is multiplied by where ranks are decided: its weight over the mobility sqrt(J M^-1
    # J^T) that its block of rows has in the home posture
    scale: Float64[np.ndarray, " t"]
    slices: list[slice]  # rows of each level; a robot on a fixed base has an empty first one

    @property
    def target(self) -> Float64[np.ndarray, " t"]:
        """J_i dv as it should be: xdd_i,ref - Jdot_i v, stacked."""
        return self.reference - self.drift

    @staticmethod
    def allocate(sizes: Sequence[int], nv: int) -> "PaperRows":
        """Zero rows."""
        slices = spans(sizes)
        total = slices[-1].stop
        return PaperRows(
            jacobian=np.zeros((total, nv)),
            drift=np.zeros(total),
            reference=np.zeros(total),
            scale=np.ones(total),
            slices=slices,
        )


class PaperFormulation:
    """Writes `PaperRows` for a stack whose contacts, if any, carry every wrench of the base."""

    def __init__(self, robot: Robot, stack: Stack) -> None:
        stack.bind(robot)
        self._contacts, tasks = stack.contacts, [task for _, task in stack.tasks()]
        sizes = [sum(c.dim for c in self._contacts)]
        sizes += [sum(task.dim for task in level) for level in stack.levels]
        self.rows = PaperRows.allocate(sizes, robot.nv)  # the rows of the last state
        owners = [*self._contacts, *tasks]
        self._owners = list(zip(owners, spans([o.dim for o in owners]), strict=True))
        home = Dynamics(robot)
        home.update(RobotState(robot.q_home, np.zeros(robot.nv)))
        mobility = np.linalg.inv(home.M)
        for owner, rows in self._owners:
            self.rows.scale[rows] = _scale(owner, home, mobility)

    def fill(self, dynamics: Dynamics) -> None:
        """Write the rows of a state."""
        filled = self.rows
        for owner, rows in self._owners:
            owner.evaluate(dynamics)
            filled.jacobian[rows], filled.drift[rows] = owner.jacobian, owner.drift
            filled.reference[rows] = owner.reference


def spans(sizes: Sequence[int]) -> list[slice]:
    """Slices of these sizes behind one another."""
    return [slice(a, b) for a, b in pairwise(accumulate(sizes, initial=0))]


def _scale(
    owner: Contact | Task, home: Dynamics, mobility: Float64[np.ndarray, "nv nv"]
) -> Float64[np.ndarray, " m"]:
    """Weight over the largest mobility among rows that turn into one another as axes turn."""
    owner.evaluate(home)
    squares = np.einsum("ij,jk,ik->i", owner.jacobian, mobility, owner.jacobian)
    if isinstance(owner, Task):
        # What it took from the home posture as its target it forgets again.
        owner.reset()
        blocks, weight = owner.blocks, owner.weight
    else:
        blocks, weight = (3,) * (owner.dim // 3), 1.0
    largest = [np.full(len(squares[rows]), squares[rows].max()) for rows in spans(blocks)]
    return weight / np.sqrt(np.concatenate(largest))
