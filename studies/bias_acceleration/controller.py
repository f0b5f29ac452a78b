"""`PaperController`: a robot on a fixed base under one of the paper's formulas.

`OldGravityRecursion`: the original formula on a planet that its bias term was not told of.
"""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from benchmarks.bias.formulas import bias_original
from benchmarks.bias.recursion import PaperRecursion
from benchmarks.bias.rows import MatrixRates, PaperFormulation, PaperRows
from benchmarks.rigid_plant import with_gravity
from poise.control import Command, CommandStatus
from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot
from poise.stack import Stack


class PaperController:
    """Torques of a `PaperRecursion`: no contacts, and no limit that it would keep.

    Args:
        robot: on a fixed base.
        stack: its tasks.
        recursion: with the formula of the bias acceleration.
        exact: whether projected Jacobians are differentiated exactly.

    Attributes:
        robot: the robot.
        recursion: what it found at the last tick.
        outside: whether some joint's acceleration left the bounds of the stack's joint limit at
            the last tick.
    """

    def __init__(
        self, robot: Robot, stack: Stack, recursion: PaperRecursion, *, exact: bool
    ) -> None:
        self.robot, self.recursion, self.outside = robot, recursion, False
        self._formulation, self._limit = PaperFormulation(robot, stack), stack.joint_limit
        self._dynamics = Dynamics(robot)
        self._rates = MatrixRates(robot) if exact else None

    def step(self, state: RobotState) -> Command:
        """One tick: from state to torques."""
        dynamics = self._dynamics
        dynamics.update(state)
        if self._rates is not None:
            self._rates.update(state)
        self._formulation.fill(dynamics, self._rates)
        acceleration = self.recursion.resolve(self._formulation.rows, dynamics)
        self._limit.evaluate(dynamics)
        self.outside = bool(
            (acceleration < self._limit.lower).any() or (acceleration > self._limit.upper).any()
        )
        torque = dynamics.M.dot(acceleration)
        torque += dynamics.h
        return Command(status=CommandStatus.OK, torque=torque, acceleration=acceleration)


class OldGravityRecursion(PaperRecursion):
    """Eq. (23) whose own term mu_i + p_i keeps a gravity while everything else knows the true one.

    What (23) takes over from the torque (17), J_i|p, Lambda_i|p and mu_i|p + p_i|p, has the true
    gravity, as the torque itself. Two tasks only.

    Args:
        robot: whose bias term.
        gravity: vertical gravity that it keeps [m/s^2].
    """

    def __init__(self, robot: Robot, gravity: float) -> None:
        super().__init__("original")
        self._old = with_gravity(robot, gravity)
        self._data = self._old.model.createData()

    def resolve(self, rows: PaperRows, dynamics: Dynamics) -> Float64[np.ndarray, " n"]:
        """The acceleration of one state, the rows with their exact derivatives."""
        super().resolve(rows, dynamics)
        _, first, second = self.tasks
        last = rows.slices[2]
        Gamma = first.J_p.T @ (first.Lambda_p @ rows.reference[rows.slices[1]] + first.mu_p)
        state = dynamics.state
        h = pin.nonLinearEffects(self._old.model, self._data, state.q, state.v)
        wrong = bias_original(second, np.linalg.inv(dynamics.M), Gamma, h)
        # By (24) a bias acceleration that is too large is a reference that is too small.
        kept = rows.reference[last].copy()
        rows.reference[last] += self.bias[2] - wrong
        acceleration = super().resolve(rows, dynamics)
        rows.reference[last] = kept
        self.bias[2] = wrong
        return acceleration
