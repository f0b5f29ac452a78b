"""`ChainJoining`: accelerations and torques of both chains put together."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled
from poise.dynamics import ReducedDynamics
from poise.stack import Stack

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


class ChainJoining:
    """Puts the answer of LQP 1 and the motion of the unconstrained chain together.

    The chain's torques are M_ua dv_a + M_uu dv_u + h_u, the exact form of (17) of Ahn et al. 2024.

    Args:
        base: number of base coordinates.
        reduced: the reduced dynamics, updated by the caller.
        stack: whose limits count.
    """

    def __init__(self, base: int, reduced: ReducedDynamics, stack: Stack) -> None:
        self._base, self._reduced, self._stack = base, reduced, stack
        self._index = reduced.partition.a.index, reduced.partition.u.index

    def join(
        self,
        x: Float64[np.ndarray, " n"],
        torque_a: Float64[np.ndarray, " na"],
        dv_u: Float64[np.ndarray, " nu"],
    ) -> Joined:
        """Both chains' accelerations and torques.

        Args:
            x: dv_a, and whatever follows it.
            torque_a: of the rows a; those of the base, near zero, first [N, N m].
            dv_u: acceleration of the unconstrained chain.
        """
        reduced, base = self._reduced, self._base
        nv = len(self._index[0]) + len(self._index[1])
        dv, torque = np.empty(nv), np.empty(nv - base)
        limit, joint = self._stack.torque_limit, self._stack.joint_limit
        within = _join(
            self._index,
            (x, torque_a, dv_u),
            (reduced.M_au, reduced.M_uu, reduced.h_u),
            (limit.lower, limit.upper, joint.lower, joint.upper),
            base,
            dv,
            torque,
        )
        return Joined(dv, torque, within)


_Motion = tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " na"], Float64[np.ndarray, " nu"]]
_Chain = tuple[
    Float64[np.ndarray, "na nu"], Float64[np.ndarray, "nu nu"], Float64[np.ndarray, " nu"]
]
_Limits = tuple[
    Float64[np.ndarray, " nj"],
    Float64[np.ndarray, " nj"],
    Float64[np.ndarray, " nj"],
    Float64[np.ndarray, " nj"],
]


@compiled
def _join(
    index: tuple[Int64[np.ndarray, " na"], Int64[np.ndarray, " nu"]],
    motion: _Motion,
    chain: _Chain,
    limits: _Limits,
    base: int,
    dv: Float64[np.ndarray, " nv"],
    torque: Float64[np.ndarray, " nj"],
) -> bool:
    a, u = index
    x, torque_a, dv_u = motion
    M_au, M_uu, h_u = chain
    tau_min, tau_max, dv_min, dv_max = limits
    for i in range(len(a)):
        dv[a[i]] = x[i]
        if a[i] >= base:
            torque[a[i] - base] = torque_a[i]
    within = True
    for i in range(len(u)):
        joint, total = u[i] - base, h_u[i]
        for j in range(len(u)):
            total += M_uu[i, j] * dv_u[j]
        for j in range(len(a)):
            total += M_au[j, i] * x[j]
        dv[u[i]], torque[joint] = dv_u[i], total
        # Written so that NaN is not within.
        if not (tau_min[joint] <= total <= tau_max[joint]):
            within = False
        if not (dv_min[joint] - _SLOP <= dv_u[i] <= dv_max[joint] + _SLOP):
            within = False
    return within
