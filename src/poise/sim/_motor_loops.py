"""`advance`: the loops of all drives. `respond`: how joints in a MuJoCo model answer to torques."""

import math
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float64, Int32, Int64

from poise._compiled import compiled, factor_leading, solve_lower
from poise.sim._motor_config import PERIOD

Joints = Float64[np.ndarray, " nj"]
Square = Float64[np.ndarray, "nj nj"]

# Kinds of constraints whose forces answer to accelerations
_QUADRATIC = int(mujoco.mjtConstraintState.mjCNSTRSTATE_QUADRATIC)
_CONE = int(mujoco.mjtConstraintState.mjCNSTRSTATE_CONE)


class DriveLoops(NamedTuple):
    """Constants of the motors; motor i is on joint i and, by a linkage, on joint `mate[i]`."""

    mate: Int64[np.ndarray, " nj"]  # itself without a linkage
    inverse: Float64[np.ndarray, "2 nj"]  # R^-1: turns of joint i with motor i, with `mate[i]`
    limit: Joints
    friction: Joints
    damping: Joints
    ripple: Joints
    wave: Joints  # phase of the ripple over the angle of the output
    notch: Joints  # step of the encoder at the output [rad]


class DriveState(NamedTuple):
    """State of the motors, at their outputs."""

    angle: Joints
    slip: Joints  # in each period, towards the angles of the physics
    speed: Joints
    counted: Joints  # angle by the encoder
    measured: Joints  # speed by the drive
    torque: Joints  # of the currents
    impulse: Joints  # of the Coulomb friction in a period [N m s]
    given: Joints  # sum of the torques with ripple and friction since the physics step began
    limited: Joints  # one where a torque was at its limit since then
    total: Joints  # torque in a period, without Coulomb friction
    asked: Joints  # torques that the loops of the joints ask for


@compiled
def advance(
    drives: DriveLoops,
    state: DriveState,
    set_points: Float64[np.ndarray, "5 nj"],
    dynamics: tuple[Joints, Square],
    follow: tuple[float, float],
    ticks: int,
) -> None:
    """Run all loops for some periods."""
    (free, response), (follow_torque, follow_speed) = dynamics, follow
    q, dq, kp, kd, tau = set_points
    mate, inverse, n = drives.mate, drives.inverse, len(drives.limit)
    for _ in range(ticks):
        for j in range(n):
            own, other = inverse[0, j], inverse[1, j]
            angle = own * state.counted[j] + other * state.counted[mate[j]]
            speed = own * state.measured[j] + other * state.measured[mate[j]]
            state.asked[j] = tau[j] + kp[j] * (q[j] - angle) + kd[j] * (dq[j] - speed)
        for i in range(n):
            limit, k = drives.limit[i], mate[i]
            asked = inverse[0, i] * state.asked[i] + inverse[1, k] * state.asked[k]
            if abs(asked) >= limit:
                state.limited[i] = 1.0
            asked = min(max(asked, -limit), limit)
            state.torque[i] += follow_torque * (asked - state.torque[i])
            ripple = drives.ripple[i] * math.sin(drives.wave[i] * state.angle[i])
            state.total[i] = state.torque[i] + ripple - drives.damping[i] * state.speed[i]
            state.given[i] += state.total[i]
        for i in range(n):
            change = PERIOD * free[i]
            for k in range(n):
                change += response[i, k] * (PERIOD * state.total[k] + state.impulse[k])
            state.asked[i] = change
        for i in range(n):
            state.speed[i] += state.asked[i]
        for i in range(n):
            most = PERIOD * drives.friction[i]
            impulse = state.impulse[i] - state.speed[i] / response[i, i]
            impulse = min(max(impulse, -most), most)
            change = impulse - state.impulse[i]
            state.impulse[i] = impulse
            if change != 0.0:
                for k in range(n):
                    state.speed[k] += response[k, i] * change
        for i in range(n):
            state.given[i] += state.impulse[i] / PERIOD
            state.angle[i] += PERIOD * state.speed[i] + state.slip[i]
            counted = state.angle[i]
            if drives.notch[i] > 0.0:
                counted = drives.notch[i] * round(counted / drives.notch[i])
            rate = (counted - state.counted[i]) / PERIOD
            state.measured[i] += follow_speed * (rate - state.measured[i])
            state.counted[i] = counted


@compiled
def respond(
    hessian: Float64[np.ndarray, "nv nv"],
    constraints: tuple[
        Float64[np.ndarray, "nefc nv"], Float64[np.ndarray, " nefc"], Int32[np.ndarray, " nefc"]
    ],
    transmission: tuple[Int64[np.ndarray, " nj"], Int64[np.ndarray, " nj"], Square],
    columns: Float64[np.ndarray, "nj nv"],
    response: Square,
) -> None:
    """Fill in R C R^T, of the inertia in `hessian` and the constraints."""
    (jacobian, stiffness, kinds), (at_v, mate, rates) = constraints, transmission
    nv, n = len(hessian), len(mate)
    for row in range(len(kinds)):
        if kinds[row] not in (_QUADRATIC, _CONE):
            continue
        for i in range(nv):
            scaled = stiffness[row] * jacobian[row, i]
            if scaled != 0.0:
                for j in range(i + 1):
                    hessian[i, j] += scaled * jacobian[row, j]
    factor_leading(hessian, nv)
    for i in range(n):
        column = columns[i]
        column[:] = 0.0
        column[at_v[i]], column[at_v[mate[i]]] = rates[i, i], rates[i, mate[i]]
        solve_lower(hessian, 0, nv, column)
        for k in range(i + 1):
            total = 0.0
            for j in range(nv):
                total += column[j] * columns[k, j]
            response[i, k] = response[k, i] = total
