"""Wrenches and torques of one acceleration in `ContactForces`, compiled."""

import numpy as np
from jaxtyping import Float64

from poise._compiled import MemoryBlock, compiled, factor_leading, part, solve_leading, view
from poise.dynamics import StateNumbers


class Balance(MemoryBlock):
    """The wrenches' metric and bounds, and what was found."""

    jacobian: Float64[np.ndarray, "c nv"]  # J_c of all contacts
    cost_inverse: Float64[np.ndarray, "c c"]  # inverse of the metric W of all wrenches
    reference: Float64[np.ndarray, " c"]  # of the internal forces [N, N m]
    rows: Float64[np.ndarray, "rows c"]  # of cones, then of bounds on normal forces: F <= limits
    limits: Float64[np.ndarray, " rows"]  # [N, N m]
    per_torque: Float64[np.ndarray, " nj"]  # one over the torque limits [1/(N m)]
    weight: Float64[np.ndarray, "1"]  # of the robot [N]
    force: Float64[np.ndarray, " nv"]  # M dv + h [N, N m]
    wrench: Float64[np.ndarray, " c"]  # [N, N m]
    torque: Float64[np.ndarray, " nj"]  # [N m]
    errors: Float64[np.ndarray, "3"]  # of base, cones and torque limits, over weight and limits
    weighted: Float64[np.ndarray, "base c"]  # scratch: J_c,u W^-1
    system: Float64[np.ndarray, "base base"]  # scratch
    multiplier: Float64[np.ndarray, " base"]  # scratch


@compiled
def solve_nearest(balance_at: int, state_at: int, dv: Float64[np.ndarray, " nv"]) -> None:
    """Find force, nearest wrenches, torques and errors of contacts that carry any base wrench."""
    weigh_base(balance_at, state_at, dv)
    balance = view(Balance, balance_at)
    if len(balance.wrench) > 0:
        # Positive definite, or NaN, which stays.
        factor_leading(balance.system, len(balance.system))
        solve_leading(balance.system, len(balance.system), balance.multiplier)
        for r in range(len(balance.wrench)):
            total = balance.reference[r]
            for i in range(len(balance.multiplier)):
                total += balance.weighted[i, r] * balance.multiplier[i]
            balance.wrench[r] = total
    measure(balance_at)


@compiled
def weigh_base(balance_at: int, state_at: int, dv: Float64[np.ndarray, " nv"]) -> None:
    """Find force_u = J_c,u^T F as equations of the multiplier, F = reference + W^-1 J_c,u x."""
    balance, state = view(Balance, balance_at), view(StateNumbers, state_at)
    M, h, J = state.M, state.h, balance.jacobian
    for i in range(len(h)):
        row, total = M[i], h[i]
        for j in range(len(dv)):
            total += row[j] * dv[j]
        balance.force[i] = total
    weighted, system, missing = balance.weighted, balance.system, balance.multiplier
    for i in range(len(system)):
        own = weighted[i]
        for r in range(len(own)):
            row, own[r] = balance.cost_inverse[r], 0.0
            for s in range(len(own)):
                own[r] += row[s] * J[s, i]
        missing[i] = balance.force[i]
        for r in range(len(own)):
            missing[i] -= balance.reference[r] * J[r, i]
        for j in range(len(system)):
            system[i, j] = 0.0
            for r in range(len(own)):
                system[i, j] += own[r] * J[r, j]


@compiled
def measure(balance_at: int) -> None:
    """Find torques of the wrenches, and errors of base, cones and torque limits; NaN stays NaN."""
    balance = view(Balance, balance_at)
    J, weight = balance.jacobian, balance.weight[0]
    base, errors, force = len(balance.system), balance.errors, balance.force
    errors[0] = errors[1] = errors[2] = 0.0
    for i in range(len(force)):
        rest = force[i]
        for r in range(len(balance.wrench)):
            rest -= balance.wrench[r] * J[r, i]
        if i < base:
            errors[0] = _larger(errors[0], abs(rest) / weight)
        else:
            balance.torque[i - base] = rest
            errors[2] = _larger(errors[2], abs(rest) * balance.per_torque[i - base] - 1.0)
    for k in range(len(balance.limits)):
        row, outside = balance.rows[k], -balance.limits[k]
        for r in range(len(balance.wrench)):
            outside += row[r] * balance.wrench[r]
        errors[1] = _larger(errors[1], outside / weight)


@part
def _larger(largest: float, value: float) -> float:
    """Return the larger of two, or NaN where either is."""
    return value if value > largest or np.isnan(value) else largest
