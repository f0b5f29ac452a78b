"""`ChainElimination`: what tasks of the unconstrained chain ask of the reduced robot."""

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled, say_if_slow
from poise.control._reduced._assignment import AssignedRows
from poise.control._reduced._eliminate import Eliminated, eliminate, restore
from poise.dynamics import ChainFactors, ReducedDynamics, from_coordinates, to_coordinates


class ChainElimination:
    """Takes the motions inside the unconstrained chain out of the hierarchy, exactly.

    With dv_u = Jbar_z z + N_z p, a row of a task in the unconstrained chain is T x + N p = r with
    x = (dv_a, z). Nothing else knows p, and its energy is p^T p / 2. So p can be chosen for any x,
    level by level: with the weighted rows of a level split into those directions that the
    freedom Z left by the levels above reaches and those that it does not,

        W N Z = U1 T1 V1^T          Z <- Z V2         [U1 U2], [V1 V2] orthogonal
        p <- p - Z V1 T1^-1 U1^T W (T x + N p - r)    meets what is reached, for any x
        U2^T W (T x + N p - r) = 0                    is left for x, at the same level

    In the end p = c - G x, and its energy belongs to x. LQP 1 with the rows that are left and the
    energy |c - G x|^2 / 2 has the solution of the whole problem as long as no limit of the
    unconstrained chain is active, whatever the order of its tasks. Where two full arms do not
    use up the freedom, nothing is left of their levels. Directions in which an arm hardly moves,
    near a singular posture, are not eliminated but join x as unknowns s, with their rows.

    A task that turns out to move with the centroids alone, N = 0, is left to LQP 1 as it is.

    Args:
        reduced: the reduced dynamics, updated by the caller.
        rows: the rows of the tasks, updated by the caller.

    Attributes:
        out: G, c and the rows that are left, with room for more than are there.
        centroid_rows: for the rows of tasks that move with the centroids, coefficients of (z, p).
        used: number of p that tasks or unknowns s have taken.
        kept: number of unknowns s.
    """

    def __init__(self, reduced: ReducedDynamics, rows: AssignedRows) -> None:
        self._reduced, self._rows = reduced, rows
        part = reduced.partition
        inside, m = part.nu - part.nz, len(rows.second)
        width, all_rows = part.nr + inside, m + len(rows.centroid)
        self.used = self.kept = 0
        self._index = part.a.index, part.u.index, np.concatenate((rows.second, rows.centroid))
        self._X, self._Y = np.zeros((all_rows, part.nu)), np.zeros((all_rows, part.nu))
        self._E, self._e = np.zeros((m, width)), np.zeros(m)
        self._P = np.zeros((m, inside))
        self.centroid_rows: Float64[np.ndarray, "k nu"] = self._Y[m:]
        self.out = Eliminated(
            G=np.zeros((inside, width)),
            c=np.zeros(inside),
            V=np.zeros((inside, inside)),
            tau=np.zeros(inside),
            rows=np.zeros((m, width)),
            values=np.zeros(m),
            left=np.zeros(len(rows.levels), dtype=np.int64),
            scratch=np.zeros(2 * m + width),
            before=np.zeros((m, inside)),
        )
        self._zp = np.zeros(part.nu)

    def update(self) -> None:
        """Eliminates p for the state of the reduced dynamics and of the tasks."""
        rows, part = self._rows, self._reduced.partition
        if part.nu:
            used, kept = _eliminate(
                (rows.J, rows.target, rows.weight, rows.second_ends),
                self._index,
                part.nz,
                self._reduced.factors,
                (self._X, self._Y, self._E, self._P, self._e),
                self.out,
            )
            self.used, self.kept = int(used), int(kept)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of unknowns s, then of rows left in each level."""
        return (self.kept, *self.out.left.tolist())

    def recover(self, x: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " nu"]:
        """Acceleration of the unconstrained chain for what LQP 1 decided.

        Args:
            x: (dv_a, z, s).

        Returns:
            dv_u = Jbar_z z + N_z (c - G x).
        """
        dv_u = np.empty(len(self._zp))
        na, nz = self._reduced.partition.na, self._reduced.partition.nz
        _recover(x, na, nz, self.used, self.out, self._reduced.factors, self._zp, dv_u)
        return dv_u


def announce() -> None:
    """Logs that the reduced controller is about to be compiled, unless it already was."""
    say_if_slow(_eliminate, "the reduced controller")


_Rows = tuple[
    Float64[np.ndarray, "m nv"],
    Float64[np.ndarray, " m"],
    Float64[np.ndarray, " m"],
    Int64[np.ndarray, " k"],
]
_Index = tuple[Int64[np.ndarray, " na"], Int64[np.ndarray, " nu"], Int64[np.ndarray, " c"]]
_Scratch = tuple[
    Float64[np.ndarray, "c nu"],
    Float64[np.ndarray, "c nu"],
    Float64[np.ndarray, "s n"],
    Float64[np.ndarray, "s np"],
    Float64[np.ndarray, " s"],
]


@compiled
def _eliminate(
    task_rows: _Rows,
    index: _Index,
    nz: int,
    factors: ChainFactors,
    scratch: _Scratch,
    out: Eliminated,
) -> tuple[int, int]:
    J, target, weight, ends = task_rows
    a, u, chosen = index
    X, Y, E, P, e = scratch
    na, m = len(a), len(e)
    for i in range(len(chosen)):
        row = chosen[i]
        # Rows that only move with the centroids are LQP 1's, which weighs them itself.
        factor = weight[row] if i < m else 1.0
        for j in range(len(u)):
            X[i, j] = factor * J[row, u[j]]
    to_coordinates(X, factors, Y)
    E[:, na + nz :] = 0.0
    for i in range(m):
        row = chosen[i]
        e[i] = weight[row] * target[row]
        for j in range(na):
            E[i, j] = weight[row] * J[row, a[j]]
        for j in range(nz):
            E[i, na + j] = Y[i, j]
        for j in range(P.shape[1]):
            P[i, j] = Y[i, nz + j]
    return eliminate(E, P, e, na + nz, ends, out)


@compiled
def _recover(
    x: Float64[np.ndarray, " n"],
    na: int,
    nz: int,
    used: int,
    out: Eliminated,
    factors: ChainFactors,
    zp: Float64[np.ndarray, " nu"],
    dv_u: Float64[np.ndarray, " nu"],
) -> None:
    for i in range(nz):
        zp[i] = x[na + i]
    p = zp[nz:]
    for k in range(len(p)):
        p[k] = out.c[k]
    for k in range(used):
        for i in range(len(x)):
            p[k] -= out.G[k, i] * x[i]
    restore(p, out.V, out.tau, used)
    from_coordinates(zp, factors, dv_u)
