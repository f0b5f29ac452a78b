"""`follow` and `join`: accelerations and torques of both chains put together.

The chain's torques are M_ua dv_a + M_uu dv_u + h_u, the exact form of (17) of Ahn et al. 2024.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, view
from poise.control._reduced._constraint_chain import ConstraintChain, ConstraintChainProblem
from poise.control._reduced._elimination import recover

_SLOP = 1e-9
"""Excess of an acceleration bound that is rounding, as a solver's own [rad/s^2]."""


class Joined(NamedTuple):
    """What both chains do.

    Attributes:
        acceleration: generalized acceleration.
        torque: joint torques [N m].
        within: whether the unconstrained chain keeps its limits of torque and acceleration.
    """

    acceleration: Float64[np.ndarray, " nv"]
    torque: Float64[np.ndarray, " nj"]
    within: bool


def follow(first: ConstraintChainProblem, x: Float64[np.ndarray, " n"]) -> Joined:
    """Both chains under a solution of LQP 1; the unconstrained one follows in closed form."""
    dv, torque = np.empty(first.nv), np.empty(first.nj)
    return Joined(dv, torque, _join(first.block.address, x, True, dv, torque))


def join(
    first: ConstraintChainProblem,
    x: Float64[np.ndarray, " n"],
    dv_u: Float64[np.ndarray, " nu"],
) -> Joined:
    """Both chains under a solution of LQP 1 and one of LQP 2."""
    dv, torque = np.empty(first.nv), np.empty(first.nj)
    first.block.chain.dv_u[:] = dv_u
    return Joined(dv, torque, _join(first.block.address, x, False, dv, torque))


@compiled
def _join(
    address: int,
    x: Float64[np.ndarray, " n"],
    follows: bool,
    dv: Float64[np.ndarray, " nv"],
    torque: Float64[np.ndarray, " nj"],
) -> bool:
    """Writes both chains' motion; the unconstrained one's is found before, if it follows."""
    first = view(ConstraintChain, address)
    if follows:
        recover(first.chain, x)
    reduced, base = first.chain.reduced, first.base
    a, u, dv_u, torque_u = reduced.a, reduced.u, first.chain.dv_u, first.torque_u
    for i in range(len(u)):
        own, total = reduced.M_uu[i], reduced.h_u[i]
        for j in range(len(u)):
            total += own[j] * dv_u[j]
        torque_u[i] = total
    for i in range(len(a)):
        dv[a[i]] = x[i]
        if a[i] >= base:
            row, total = first.A[i], reduced.h_a[i]
            for j in range(len(x)):
                total += row[j] * x[j]
            torque[a[i] - base] = total
    for i in reduced.carriers:
        own = reduced.M_au[i]
        for j in range(len(u)):
            torque_u[j] += own[j] * x[i]
    within = True
    for i in range(len(u)):
        joint = u[i] - base
        dv[u[i]], torque[joint] = dv_u[i], torque_u[i]
        # Written so that NaN is not within.
        if not (first.tau_min[joint] <= torque_u[i] <= first.tau_max[joint]):
            within = False
        if not (first.dv_min[joint] - _SLOP <= dv_u[i] <= first.dv_max[joint] + _SLOP):
            within = False
    return within
