"""Coordinates of a free chain in which its inertia is one, and its centroid comes first.

With M_uu = L L^T and the rows A of the wrench that the chain puts on its body, reflections Q make
A L^-T Q lower triangular. In the coordinates Q^T L^T dv_u = (z, p) the wrench is that of z alone,
and the energy dv_u^T M_uu dv_u is |z|^2 + |p|^2. See `ReducedDynamics` for the equations; here they
are compiled. Neither L^-1 nor Q is ever made.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import (
    compiled,
    factor,
    make_reflection,
    reflect,
    reflect_rows,
    solve_rows,
    solve_transposed,
)

CENTROID_DIM = 6
"""Coordinates of a centroid, that is of a wrench. Chains of no more joints gain nothing by one."""


class ChainFactors(NamedTuple):
    """What the coordinates are made of, for all free chains of a robot together.

    Attributes:
        chains: where each chain's joints begin and end in `u`.
        order: for each of the coordinates (z, p), its place while reflecting: a centroid takes
            the first six places of its chain.
        L: Cholesky factor of M_uu.
        V: the reflections' vectors, each from its own place on.
        tau: the reflections' factors.
    """

    chains: Int64[np.ndarray, "chains 2"]
    order: Int64[np.ndarray, " nu"]
    L: Float64[np.ndarray, "nu nu"]
    V: Float64[np.ndarray, "nz nu"]
    tau: Float64[np.ndarray, " nz"]

    @classmethod
    def allocate(cls, chains: Int64[np.ndarray, "chains 2"]) -> "ChainFactors":
        """Room for the chains of a robot.

        Args:
            chains: where each begins and ends in `u`.
        """
        starts = chains[:, :1] + np.arange(CENTROID_DIM)
        nu = int(chains[-1, 1]) if len(chains) else 0
        inside = np.setdiff1d(np.arange(nu), starts)
        nz = starts.size
        return cls(
            chains=chains,
            order=np.concatenate((starts.ravel(), inside)),
            L=np.zeros((nu, nu)),
            V=np.zeros((nz, nu)),
            tau=np.zeros(nz),
        )


@compiled
def find_coordinates(
    M_uu: Float64[np.ndarray, "nu nu"],
    A: Float64[np.ndarray, "six nu"],
    coupled: Float64[np.ndarray, "k nu"],
    factors: ChainFactors,
) -> bool:
    """Factors M_uu and turns each chain's wrench into its centroid.

    Args:
        M_uu: mass matrix of the chains.
        A: wrenches of the chains' motion; overwritten.
        coupled: further rows that are combinations of them, in v's coordinates; overwritten with
            what maps (z, p), at the places that `ChainFactors.order` gives.
        factors: receives the rest.

    Returns:
        Whether M_uu is positive definite.
    """
    chains, _, L, V, tau = factors
    if not factor(M_uu, L):
        return False
    solve_rows(L, A)
    solve_rows(L, coupled)
    for chain in range(len(chains)):
        first, end = chains[chain]
        for j in range(CENTROID_DIM):
            k, place = CENTROID_DIM * chain + j, first + j
            v = V[k, : end - place]
            tau[k] = make_reflection(A[j, place:end], v)
            reflect_rows(A[j + 1 :, place:end], v, tau[k])
            reflect_rows(coupled[:, place:end], v, tau[k])
    return True


@compiled
def to_coordinates(
    X: Float64[np.ndarray, "m nu"], factors: ChainFactors, out: Float64[np.ndarray, "m nu"]
) -> None:
    """Rows that map dv_u become rows that map (z, p): [X Jbar_z, X N_z].

    Args:
        X: overwritten.
        factors: the coordinates.
        out: receives the rows.
    """
    chains, order, L, V, tau = factors
    solve_rows(L, X)
    for chain in range(len(chains)):
        first, end = chains[chain]
        for j in range(CENTROID_DIM):
            k, place = CENTROID_DIM * chain + j, first + j
            reflect_rows(X[:, place:end], V[k, : end - place], tau[k])
    for row in range(len(X)):
        for i in range(len(order)):
            out[row, i] = X[row, order[i]]


@compiled
def from_coordinates(
    zp: Float64[np.ndarray, " nu"], factors: ChainFactors, out: Float64[np.ndarray, " nu"]
) -> None:
    """The dv_u of coordinates (z, p): Jbar_z z + N_z p.

    Args:
        zp: the coordinates.
        factors: the coordinates' own.
        out: receives dv_u.
    """
    chains, order, L, V, tau = factors
    for i in range(len(order)):
        out[order[i]] = zp[i]
    for chain in range(len(chains)):
        first, end = chains[chain]
        for j in range(CENTROID_DIM - 1, -1, -1):
            k, place = CENTROID_DIM * chain + j, first + j
            reflect(out[place:end], V[k, : end - place], tau[k])
    solve_transposed(L, out)
