"""Coordinates of a free chain in which its inertia is one, and its centroid comes first.

With M_uu = U U^T and the rows A of the wrench that the chain puts on its body, reflections Q make
A U^-T Q lower triangular. In the coordinates Q^T U^T dv_u = (z, p) the wrench is that of z alone,
and the energy dv_u^T M_uu dv_u is |z|^2 + |p|^2. See `ReducedDynamics` for the equations. Neither
U^-1 nor Q is ever made.

Rows that map dv_u stand in the columns of a matrix, side by side, so that one pass turns them all.
"""

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import (
    MemoryBlock,
    allocate,
    factor,
    make_reflection,
    part,
    reflect,
    reflect_columns,
    solve_columns,
    solve_transposed,
)

CENTROID_DIM = 6
"""Coordinates of a centroid, that is of a wrench. Chains of no more joints gain nothing by one."""


class ChainFactors(MemoryBlock):
    """Factors of the coordinates (z, p) of all free chains of a robot together."""

    chains: Int64[np.ndarray, "chains ends"]  # begin and end of each chain's joints in `u`
    order: Int64[np.ndarray, " nu"]  # place of (z, p) in reflections; z first in their chain
    reach: Int64[np.ndarray, " nu"]  # end in `u` of the joints that hang on each joint
    U: Float64[np.ndarray, "nu nu"]  # factor of M_uu, zero between branches
    V: Float64[np.ndarray, "nz nu"]  # the reflections' vectors
    tau: Float64[np.ndarray, " nz"]  # the reflections' factors
    turned: Float64[np.ndarray, " nu"]  # scratch: input of a reflection


def chain_factors(
    chains: Int64[np.ndarray, "chains 2"], reach: Int64[np.ndarray, " nu"]
) -> ChainFactors:
    """Make room for the chains of a robot."""
    starts = chains[:, :1] + np.arange(CENTROID_DIM)
    inside = np.setdiff1d(np.arange(len(reach)), starts)
    sizes = {"nu": len(reach), "nz": starts.size}
    order = np.concatenate((starts.ravel(), inside))
    return allocate(ChainFactors, sizes, chains=chains, order=order, reach=reach)


@part
def find_coordinates(
    M_uu: Float64[np.ndarray, "nu nu"],
    rows: Float64[np.ndarray, "nu k"],
    factors: ChainFactors,
    shares: Float64[np.ndarray, " k"],
) -> bool:
    """Factor M_uu and turn each chain's wrench into its centroid."""
    if not factor(M_uu, factors.reach, factors.U):
        return False
    solve_columns(factors.U, factors.reach, rows)
    for chain in range(len(factors.chains)):
        first, end = factors.chains[chain]
        for j in range(CENTROID_DIM):
            k, place = CENTROID_DIM * chain + j, first + j
            for i in range(place, end):
                factors.turned[i] = rows[i, j]
            v = factors.V[k]
            factors.tau[k] = make_reflection(factors.turned[place:end], v[place:end])
            reflect_columns(rows, place, end, j, v, factors.tau[k], shares)
    return True


@part
def to_coordinates(
    X: Float64[np.ndarray, "nu m"], factors: ChainFactors, shares: Float64[np.ndarray, " m"]
) -> None:
    """Turn rows that map dv_u into rows that map (z, p), [X Jbar_z, X N_z], in place."""
    solve_columns(factors.U, factors.reach, X)
    for chain in range(len(factors.chains)):
        first, end = factors.chains[chain]
        for j in range(CENTROID_DIM):
            k = CENTROID_DIM * chain + j
            reflect_columns(X, first + j, end, 0, factors.V[k], factors.tau[k], shares)


@part
def from_coordinates(
    zp: Float64[np.ndarray, " nu"], factors: ChainFactors, out: Float64[np.ndarray, " nu"]
) -> None:
    """Find the dv_u of coordinates (z, p): Jbar_z z + N_z p."""
    for i in range(len(zp)):
        out[factors.order[i]] = zp[i]
    for chain in range(len(factors.chains)):
        first, end = factors.chains[chain]
        for j in range(CENTROID_DIM - 1, -1, -1):
            k, place = CENTROID_DIM * chain + j, first + j
            reflect(out[place:end], factors.V[k, place:end], factors.tau[k])
    solve_transposed(factors.U, factors.reach, out)
