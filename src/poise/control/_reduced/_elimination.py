"""`ChainElimination`: conditions of tasks in the unconstrained chain on the reduced robot."""

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock, allocate, compiled, part, say_if_slow, view
from poise.control._reduced._assignment import AssignedRows
from poise.control._reduced._eliminate import ChainRows, answer, chain_rows, eliminate
from poise.dynamics import (
    Dynamics,
    ReducedDynamics,
    ReducedMatrices,
    StateNumbers,
    from_coordinates,
    reduce_dynamics,
)


class Elimination(MemoryBlock):
    """A `ChainElimination` for compiled code."""

    reduced: ReducedMatrices
    J: Float64[np.ndarray, "t nv"]  # coefficients of dv of the tasks' rows
    target: Float64[np.ndarray, " t"]  # their right-hand sides
    weight: Float64[np.ndarray, " t"]  # of each row in its level
    second: Int64[np.ndarray, " m"]  # rows that need the unconstrained chain's own joints
    moving: Int64[np.ndarray, " moving"]  # coordinates of `u` that may move each
    moving_ends: Int64[np.ndarray, " moving_ends"]  # of those of each; the first entry is zero
    seen: Int64[np.ndarray, " seen"]  # places in `a` of the coordinates that may move any
    through: Int64[np.ndarray, " through"]  # rows that move with the centroids
    variables: Int64[np.ndarray, " x"]  # of LQP 1 that x = (dv_seen, z) are
    rows: ChainRows  # the second ones, eliminated
    centroid: Float64[np.ndarray, "nz through"]  # coefficients of z; a column for each row
    turned: Float64[np.ndarray, "nu wide"]  # scratch: the carriers' rows, then both, in (z, p)
    shares: Float64[np.ndarray, " wide"]  # scratch
    dv_u: Float64[np.ndarray, " nu"]  # acceleration of the unconstrained chain, once it is known
    y: Float64[np.ndarray, " y_np"]  # scratch: (x, 1, s)
    zp: Float64[np.ndarray, " nu"]  # scratch: (z, p)


class ChainElimination:
    """Takes the motions inside the unconstrained chain out of the hierarchy, exactly.

    With dv_u = Jbar_z z + N_z p, a row of a task in the unconstrained chain is T x + N p = r with
    x = (dv_a, z). Nothing else depends on p, and its energy is p^T p / 2. So p can be chosen for
    any x, level by level: with the weighted rows of a level split into those directions that the
    freedom Z left by the levels above reaches and those that it does not,

        W N Z = U1 T1 V1^T          Z <- Z V2         [U1 U2], [V1 V2] orthogonal
        p <- p - Z V1 T1^-1 U1^T W (T x + N p - r)    meets those reached, for any x
        U2^T W (T x + N p - r) = 0                    remains for x, at the same level

    In the end p = c - G x, and its energy belongs to x. LQP 1 with the rows that are left and the
    energy |c - G x|^2 / 2 has the solution of the whole problem as long as no limit of the
    unconstrained chain is active, whatever the order of its tasks. Where two full arms do not
    use up the freedom, their levels become empty. Directions in which an arm hardly moves,
    near a singular posture, are not eliminated but join x as unknowns s, with their rows.

    Of a level whose rows outnumber what they depend on, as those of a posture do once the arms have
    used up the freedom, an orthogonal combination remains: no more rows than unknowns, however many
    joints the chain has. Of dv_a only those coordinates count that move a frame of such a task.

    A task that turns out to move with the centroids alone, N = 0, is left to LQP 1 as it is.
    """

    def __init__(self, reduced: ReducedDynamics, rows: AssignedRows) -> None:
        chains, seen = reduced.partition, rows.seen
        inside, fixed = chains.nu - chains.nz, 1 + len(seen) + chains.nz
        self._rows = chain_rows(fixed, inside, rows.second_ends)
        wide = len(reduced.matrices.shares) + len(rows.second) + len(rows.centroid)
        self.block = allocate(
            Elimination,
            {"nu": chains.nu, "nz": chains.nz, "through": len(rows.centroid), "wide": wide}
            | {"y_np": fixed + inside},
            reduced=reduced.matrices,
            J=rows.J,
            target=rows.target,
            weight=rows.weight,
            second=rows.second,
            moving=rows.moving,
            moving_ends=rows.moving_ends,
            seen=seen,
            through=rows.centroid,
            variables=np.concatenate((seen, np.arange(chains.na, chains.nr))),
            rows=self._rows,
        )

    def update(self, dynamics: Dynamics) -> None:
        """Reduce the dynamics, and eliminate p for the state of the tasks."""
        _eliminate(self.block.address, dynamics.numbers.address)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of unknowns s, then of rows left in each level."""
        return (self._rows.kept, *self._rows.left.tolist())

    def recover(self, x: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " nu"]:
        """Find the acceleration of the unconstrained chain for a solution of LQP 1."""
        _recover(self.block.address, np.ascontiguousarray(x))
        return self.block.dv_u.copy()


def announce() -> None:
    """Log that the reduced controller is about to be compiled, unless it already was."""
    say_if_slow(_eliminate, "the reduced controller")


@compiled
def _eliminate(address: int, state_at: int) -> None:
    eliminate_chain(view(Elimination, address), view(StateNumbers, state_at))


@part
def eliminate_chain(chain: Elimination, state: StateNumbers) -> None:
    """Reduce the dynamics, and eliminate p for the state of the tasks."""
    _read_rows(chain)
    reduce_dynamics(chain.reduced, chain.turned, chain.shares, state)
    if len(chain.turned) > 0:
        _sort_coordinates(chain)
        eliminate(chain.rows)


@part
def _read_rows(chain: Elimination) -> None:
    """Read weighted rows, at coordinates that move them."""
    a, u, X, E = chain.reduced.a, chain.reduced.u, chain.turned, chain.rows.E
    first = len(chain.reduced.shares)
    X[:] = 0.0
    for k in range(len(chain.second)):
        row = chain.second[k]
        own, weight = chain.J[row], chain.weight[row]
        for at in range(chain.moving_ends[k], chain.moving_ends[k + 1]):
            i = chain.moving[at]
            X[i, first + k] = weight * own[u[i]]
        for i in range(len(chain.seen)):
            E[i, k] = weight * own[a[chain.seen[i]]]
        E[len(E) - 1, k] = -weight * chain.target[row]
    # LQP 1 weighs these itself.
    for k in range(len(chain.through)):
        own = chain.J[chain.through[k]]
        for i in range(len(u)):
            X[i, first + len(chain.second) + k] = own[u[i]]


@part
def _sort_coordinates(chain: Elimination) -> None:
    """Sort coefficients into those of z and of p."""
    rows, nz, order = chain.rows, len(chain.centroid), chain.reduced.factors.order
    first, m = len(chain.reduced.shares), len(chain.second)
    for i in range(len(rows.ease)):
        rows.ease[i] = 1.0 / chain.reduced.M[chain.variables[i], chain.variables[i]]
    for i in range(len(order)):
        own = chain.turned[order[i]]
        kept = rows.E[len(chain.seen) + i] if i < nz else rows.P[i - nz]
        for k in range(m):
            kept[k] = own[first + k]
        if i < nz:
            for k in range(len(chain.through)):
                chain.centroid[i, k] = own[first + m + k]


@compiled
def _recover(address: int, x: Float64[np.ndarray, " n"]) -> None:
    recover(view(Elimination, address), x)


@part
def recover(chain: Elimination, x: Float64[np.ndarray, " n"]) -> None:
    """Find the acceleration of the unconstrained chain for a solution of LQP 1."""
    if len(chain.dv_u) == 0:
        return
    nz, fixed, nr = len(chain.centroid), len(chain.variables), len(chain.reduced.M)
    for i in range(fixed):
        chain.y[i] = x[chain.variables[i]]
    chain.y[fixed] = 1.0
    for i in range(chain.rows.kept):
        chain.y[fixed + 1 + i] = x[nr + i]
    for i in range(nz):
        chain.zp[i] = x[nr - nz + i]
    answer(chain.rows, chain.y, chain.zp[nz:])
    from_coordinates(chain.zp, chain.reduced.factors, chain.dv_u)
