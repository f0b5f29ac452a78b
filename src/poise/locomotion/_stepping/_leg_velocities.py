"""`LegVelocities`: from what body and feet shall do to velocities of the legs' joints.

`TaskWeights`: W_A, how much each task of the second level counts.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.control import VelocityLevel, base_from_joints, constrained, limit_weights, solve_levels
from poise.dynamics import RobotState, rotation_vector, saturate
from poise.locomotion._stepping._biped import Biped
from poise.locomotion._stepping._footing import Footing
from poise.locomotion._stepping._parameters import TeleopParameters
from poise.locomotion._stepping._rules import Rules

_PAPER_K1, _PAPER_K2, _PAPER_S2 = 4500.0, 7000.0, 100.0
"""k_1 and k_2 of (39c) and w_S2, as the paper has them; used where `Rules` ask for them."""

_UPRIGHT_WEIGHT = 100.0
"""Weight of the torso's angular velocity while the operator asks for an upright torso."""

_MOMENTUM, _TORSO, _FOOT = slice(0, 2), slice(2, 5), slice(5, 8)


class TaskWeights:
    """Eqs (39c) and (39d) of angular momentum, torso and foot.

    Args:
        parameters: weights.
        rules: departures from the paper.
        rotator: whether the body rotator acts.
    """

    def __init__(self, parameters: TeleopParameters, rules: Rules, *, rotator: bool) -> None:
        self._parameters, self._rules, self._rotator = parameters, rules, rotator

    def at(
        self, footing: Footing, zmp: Float64[np.ndarray, "2"], *, upright: bool
    ) -> Float64[np.ndarray, "8"]:
        """The weights.

        Args:
            footing: of the tick.
            zmp: measured [m].
            upright: whether the operator asks for an upright torso.
        """
        p, weights = self._parameters, np.empty(8)
        if footing.mode.single:
            weights[_FOOT] = self._swing(footing)
            self._turn(weights, footing, zmp)
            if upright:
                weights[_TORSO] = _UPRIGHT_WEIGHT
        else:
            weights[_MOMENTUM], weights[_TORSO] = p.epsilon, p.w_B
            weights[_FOOT] = p.w_S2 if self._rules.firm_feet else _PAPER_S2
        return weights

    def _turn(
        self,
        weights: Float64[np.ndarray, "8"],
        footing: Footing,
        zmp: Float64[np.ndarray, "2"],
    ) -> None:
        """Weights of angular momentum and torso on one foot."""
        p = self._parameters
        if not self._rotator:
            weights[_MOMENTUM], weights[_TORSO] = p.epsilon, p.w_B
        elif self._rules.constant_weights:
            weights[_MOMENTUM], weights[_TORSO] = p.w_L, p.w_B1
            if self._rules.bounded_tilt:
                weights[_TORSO] *= 1.0 + (footing.tilt / p.tilt_soft) ** 4
        else:
            x, y = (footing.zmp_reference - zmp).tolist()
            weights[0] = max(_PAPER_K1 * y * y, p.epsilon)
            weights[1] = max(_PAPER_K2 * x * x, p.epsilon)
            weights[_TORSO] = p.epsilon

    def _swing(self, footing: Footing) -> float:
        """Weight of the swing foot: firm on the ground, the paper's from `clear_height` on."""
        p = self._parameters
        if not self._rules.firm_lift:
            return p.w_S1
        clear = footing.clearance(footing.lowest_ground, p.clear_height)
        return p.w_S2 ** (1.0 - clear) * p.w_S1**clear


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
