"""The paper's (17): torques of the unconstrained chain as if the base did not accelerate."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.control import Command
from poise.dynamics import Dynamics, Partition, Partitions, RobotState
from poise.robots import Robot


class PaperTorques:
    """What (17), M_uc dv_uc + b_uc + g_uc = torque, leaves out of the exact rows.

    The exact rows are M_ua dv_a + M_uu dv_u + h_u. "On the frame of the base" b_uc may be read
    in two ways: with the base's velocity, or as that of a robot whose base is fixed.

    Args:
        robot: the robot, on two soles.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._partitions = robot, Partitions(robot)
        self._dynamics = Dynamics(robot)
        self._data = robot.model.createData()

    def partition(self, contacts: tuple[str, ...]) -> Partition:
        """The chains for the frames in contact."""
        return self._partitions.of(contacts)

    def left_out(
        self,
        state: RobotState,
        dv: Float64[np.ndarray, " nv"],
        contacts: tuple[str, ...],
        *,
        fixed_base: bool = False,
    ) -> Float64[np.ndarray, " nj"]:
        """Torque that is missing by joint, zero outside of the unconstrained chain [N m].

        Args:
            state: the state.
            dv: acceleration that is wanted.
            contacts: frames in contact.
            fixed_base: whether b_uc is that of a base that does not move, either.
        """
        part, base = self.partition(contacts), self._robot.base_dofs
        self._dynamics.update(state)
        a, u = part.a.index, part.u.index
        torque = self._dynamics.M[np.ix_(u, a)] @ dv[a]
        if fixed_base:
            still = state.v.copy()
            still[:base] = 0.0
            h = pin.nonLinearEffects(self._robot.model, self._data, state.q, still)
            torque += (self._dynamics.h - h)[u]
        missing = np.zeros(self._robot.nj)
        missing[u - base] = torque
        return missing

    def alter(self, state: RobotState, command: Command) -> Command:
        """A command as (17) would have given it, in contact wherever a wrench was expected."""
        if command.torque is None or command.acceleration is None:
            return command
        missing = self.left_out(state, command.acceleration, tuple(command.wrenches))
        return replace(command, torque=command.torque - missing)
