"""The wrenches and torques of one acceleration in `ContactForces`, compiled."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, factor_leading, part, solve_leading


class Balance(NamedTuple):
    """What the wrenches are chosen by, and what was found.

    Attributes:
        cost_inverse: inverse of the metric W of all wrenches.
        reference: wrenches that the internal forces should come near [N, N m].
        rows: of the cones, then of the bounds on normal forces: rows F <= limits.
        limits: of these rows [N, N m].
        per_torque: one over the torque limits [1/(N m)].
        weight: of the robot [N].
        force: receives M dv + h [N, N m].
        wrench: receives the wrenches [N, N m].
        torque: receives the joint torques [N m].
        errors: receives what base, cones and torque limits miss, over weight and limits.
        weighted: scratch, W^-1 J_c,u^T in rows.
        system: scratch.
        multiplier: scratch.
    """

    cost_inverse: Float64[np.ndarray, "c c"]
    reference: Float64[np.ndarray, " c"]
    rows: Float64[np.ndarray, "rows c"]
    limits: Float64[np.ndarray, " rows"]
    per_torque: Float64[np.ndarray, " nj"]
    weight: float
    force: Float64[np.ndarray, " nv"]
    wrench: Float64[np.ndarray, " c"]
    torque: Float64[np.ndarray, " nj"]
    errors: Float64[np.ndarray, "3"]
    weighted: Float64[np.ndarray, "base c"]
    system: Float64[np.ndarray, "base base"]
    multiplier: Float64[np.ndarray, " base"]


@compiled
def solve_nearest(
    M: Float64[np.ndarray, "nv nv"],
    h: Float64[np.ndarray, " nv"],
    dv: Float64[np.ndarray, " nv"],
    J: Float64[np.ndarray, "c nv"],
    balance: Balance,
) -> None:
    """Force, nearest wrenches, torques and errors where the contacts carry any base wrench."""
    weigh_base(M, h, dv, J, balance)
    if len(balance.wrench) > 0:
        # Positive definite, or NaN, which stays.
        factor_leading(balance.system, len(balance.system))
        solve_leading(balance.system, len(balance.system), balance.multiplier)
        _spread(balance)
    measure(J, balance)


@compiled
def weigh_base(
    M: Float64[np.ndarray, "nv nv"],
    h: Float64[np.ndarray, " nv"],
    dv: Float64[np.ndarray, " nv"],
    J: Float64[np.ndarray, "c nv"],
    balance: Balance,
) -> None:
    """The force, and the base's equations J_c,u^T F = force_u on the wrenches' multiplier.

    Wrenches of least cost are F = reference + W^-1 J_c,u multiplier.
    """
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
def measure(J: Float64[np.ndarray, "c nv"], balance: Balance) -> None:
    """Torques of the wrenches, and what base, cones and torque limits miss; NaN stays NaN."""
    base, errors, force = len(balance.system), balance.errors, balance.force
    errors[0] = errors[1] = errors[2] = 0.0
    for i in range(len(force)):
        rest = force[i]
        for r in range(len(balance.wrench)):
            rest -= balance.wrench[r] * J[r, i]
        if i < base:
            errors[0] = _larger(errors[0], abs(rest) / balance.weight)
        else:
            balance.torque[i - base] = rest
            errors[2] = _larger(errors[2], abs(rest) * balance.per_torque[i - base] - 1.0)
    for k in range(len(balance.limits)):
        row, outside = balance.rows[k], -balance.limits[k]
        for r in range(len(balance.wrench)):
            outside += row[r] * balance.wrench[r]
        errors[1] = _larger(errors[1], outside / balance.weight)


@part
def _spread(balance: Balance) -> None:
    """The wrenches of a multiplier."""
    for r in range(len(balance.wrench)):
        total = balance.reference[r]
        for i in range(len(balance.multiplier)):
            total += balance.weighted[i, r] * balance.multiplier[i]
        balance.wrench[r] = total


@part
def _larger(largest: float, value: float) -> float:
    """The larger of two, or NaN where either is."""
    return value if value > largest or np.isnan(value) else largest
