"""`LegVelocities`: from what body and feet shall do to velocities of the legs' joints."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.balance import saturate
from poise.control.differential_ik.closed_form import VelocityLevel, solve_levels
from poise.control.differential_ik.joint_weights import limit_weights
from poise.control.differential_ik.stance import base_from_joints, constrained
from poise.dynamics.rotations import rotation_vector
from poise.dynamics.state import RobotState
from poise.teleop.biped import Biped
from poise.teleop.footing import Footing
from poise.teleop.parameters import TeleopParameters
from poise.teleop.rules import Rules

_LIMIT_TIME = 0.05
"""Time in which a joint may at most reach its position limit [s]."""

_FIRST, _SECOND = slice(0, 6), slice(6, 14)
"""Rows of the two levels in (19)."""

_LEVEL = np.eye(3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Wanted:
    """What a tick asks of the legs.

    Attributes:
        com: velocity of the COM along the ground [m/s].
        lift: velocity of the COM upwards [m/s].
        momentum: angular, about the COM, x and y [kg m^2/s].
        foot: velocity of the sole that is not the stance [m/s].
        weights: of the second level's rows, W_A.
    """

    com: Float64[np.ndarray, "2"]
    lift: float
    momentum: Float64[np.ndarray, "2"]
    foot: Float64[np.ndarray, "3"]
    weights: Float64[np.ndarray, "8"]


class LegVelocities:
    """Eqs (19) to (23), with (17b) and (17d) for torso and sole, which are kept level.

    The first level has the COM's velocity and the other sole's angular velocity; the second has
    angular momentum, the torso's angular velocity and the other sole's velocity.

    Args:
        biped: the robot.
        parameters: gains and limits.
        rules: departures from the paper.
    """

    def __init__(self, biped: Biped, parameters: TeleopParameters, rules: Rules) -> None:
        self._biped, self._parameters, self._rules = biped, parameters, rules
        base = biped.robot.base_dofs
        self._base, self._columns = base, biped.legs + base
        self._all_columns = np.concatenate((np.arange(base), self._columns))
        self._ones = np.ones(8)

    def solve(
        self, estimate: RobotState, footing: Footing, wanted: Wanted
    ) -> Float64[np.ndarray, " nj"]:
        """Velocities of all joints; those that are not the legs' are zero [rad/s].

        Args:
            estimate: the robot's state.
            footing: of the tick.
            wanted: of the legs.
        """
        biped = self._biped
        stacked = self._stacked(footing)
        contact = footing.dynamics.frame(biped.frames[footing.stance]).jacobian
        base_map = base_from_joints(contact[:, self._all_columns])
        rows = constrained(stacked[:, self._all_columns], base_map)
        velocity = self._velocities(footing, wanted)
        if self._rules.level_stance:
            velocity = velocity - self._drift(footing, stacked[:, : self._base])
        ones = self._ones
        levels = [
            VelocityLevel(rows[_FIRST], velocity[_FIRST], ones[:6], ones[:6]),
            VelocityLevel(rows[_SECOND], velocity[_SECOND], wanted.weights, ones),
        ]
        q, rate = estimate.q[1:][self._columns], estimate.v[self._columns]
        legs = solve_levels(levels, limit_weights(q, rate, biped.q_min, biped.q_max))
        legs = np.clip(legs, (biped.q_min - q) / _LIMIT_TIME, (biped.q_max - q) / _LIMIT_TIME)
        joints = np.zeros(biped.robot.nj)
        joints[biped.legs] = np.clip(legs, -biped.v_max, biped.v_max)
        return joints

    def _stacked(self, footing: Footing) -> Float64[np.ndarray, "14 nv"]:
        """J_1 and J_2 of (19), of all velocities."""
        dynamics = footing.dynamics
        sole = dynamics.frame(self._biped.frames[footing.other]).jacobian
        torso = dynamics.frame(self._biped.torso).jacobian
        momentum = dynamics.momentum_matrix[3:5]
        return np.concatenate((dynamics.com_jacobian, sole[3:], momentum, torso[3:], sole[:3]))

    def _velocities(self, footing: Footing, wanted: Wanted) -> Float64[np.ndarray, "14"]:
        """v_1 and v_2 of (19)."""
        p, dynamics = self._parameters, footing.dynamics
        sole = dynamics.frame(self._biped.frames[footing.other]).rotation
        torso = dynamics.frame(self._biped.torso).rotation
        velocity = np.empty(14)
        velocity[:2], velocity[2] = wanted.com, wanted.lift
        velocity[3:6] = saturate(p.omega_lim, p.k_omega * rotation_vector(_LEVEL, sole))
        velocity[6:8] = wanted.momentum
        velocity[8:11] = saturate(p.omega_lim, p.k_omega * rotation_vector(_LEVEL, torso))
        velocity[11:] = wanted.foot
        return velocity

    def _drift(
        self, footing: Footing, base_columns: Float64[np.ndarray, "14 6"]
    ) -> Float64[np.ndarray, "14"]:
        """What the rows do by themselves while a stance sole that is not level is turned back."""
        p, frame = self._parameters, footing.dynamics.frame(self._biped.frames[footing.stance])
        tilt = rotation_vector(_LEVEL, frame.rotation)
        tilt[2] = 0.0
        twist = np.zeros(6)
        twist[3:] = saturate(p.omega_lim, p.k_level * tilt)
        return base_columns @ np.linalg.solve(frame.jacobian[:, : self._base], twist)
