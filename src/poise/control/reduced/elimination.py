"""`ChainElimination`: what tasks of the unconstrained chain ask of the reduced robot."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64
from scipy.linalg import lapack

from poise.control.reduced.assignment import Assignment
from poise.dynamics import ReducedDynamics

RANK_TOLERANCE = 1e-8
"""Pivots smaller than this, relative to the first, are no motion that a task can use."""

WEAK = 1e-2
"""Pivots smaller than this stay unknowns: eliminated, their inverse squares would be in the energy,
and a nearly straight arm cost LQP 1 its accuracy."""


class LevelDemand(NamedTuple):
    """What is left of one level for LQP 1: rows x = values, with weights in them.

    Attributes:
        rows: coefficients of (dv_a, z, s), or of its beginning.
        values: right-hand sides.
    """

    rows: Float64[np.ndarray, "k n"]
    values: Float64[np.ndarray, " k"]


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

    Args:
        reduced: the reduced dynamics, updated by the caller.
        levels: the tasks that act, level by level.

    Attributes:
        demands: what each level leaves for LQP 1, at the last state.
        G: how p answers to x = (dv_a, z, s).
        c: p at x = 0.
        kept: number of unknowns s.
    """

    def __init__(self, reduced: ReducedDynamics, levels: Sequence[Sequence[Assignment]]) -> None:
        self._reduced = reduced
        self._levels = [[a for a in level if len(a.second)] for level in levels]
        part = reduced.partition
        self._inside, self._nr = part.nu - part.nz, part.nr
        self._nothing = LevelDemand(np.zeros((0, part.nr)), np.zeros(0))
        self.demands: list[LevelDemand] = [self._nothing] * len(self._levels)
        self.kept = 0
        self.G: Float64[np.ndarray, "np n"] = np.zeros((self._inside, part.nr))
        self.c: Float64[np.ndarray, " np"] = np.zeros(self._inside)

    def update(self) -> None:
        """Eliminates p for the state of the reduced dynamics and of the tasks."""
        self.kept = 0
        self.G = np.zeros((self._inside, self._nr))
        self.c[:] = 0.0
        Z = np.eye(self._inside)
        for i, level in enumerate(self._levels):
            if level:
                Z, self.demands[i] = self._eliminate(level, Z)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of unknowns s, then of rows left in each level."""
        return (self.kept, *(len(demand.values) for demand in self.demands))

    def recover(self, x: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " nu"]:
        """Acceleration of the unconstrained chain for what LQP 1 decided.

        Args:
            x: (dv_a, z, s).

        Returns:
            dv_u = Jbar_z z + N_z (c - G x).
        """
        p = self.c - self.G.dot(x)
        dv_u = self._reduced.Jbar_z.dot(x[self._reduced.partition.na : self._nr])
        dv_u += self._reduced.N_z.dot(p)
        return dv_u

    def _eliminate(
        self, level: list[Assignment], Z: Float64[np.ndarray, "np d"]
    ) -> tuple[Float64[np.ndarray, "np e"], LevelDemand]:
        T, N, r = self._rows(level)
        split = _split(N.dot(Z))
        # What is missing at x, given p so far: E x - e.
        E, e = self._missing(T, N, r)
        if split is None:
            return Z, LevelDemand(E, e)
        strong, T1_inverse = split.strong, split.T1_inverse
        answer = Z.dot(split.V[:, :strong].dot(T1_inverse.dot(split.U[:, :strong].T)))
        self.G += answer.dot(E)
        self.c += answer.dot(e)
        if split.rank > strong:
            self.G = np.hstack((self.G, -Z.dot(split.V[:, strong : split.rank])))
            self.kept += split.rank - strong
        demand, rest = self._nothing, split.U[:, strong:].T
        if len(rest):
            E, e = self._missing(T, N, r)
            demand = LevelDemand(rest.dot(E), rest.dot(e))
        return Z.dot(split.V[:, split.rank :]), demand

    def _missing(
        self,
        T: Float64[np.ndarray, "m nr"],
        N: Float64[np.ndarray, "m np"],
        r: Float64[np.ndarray, " m"],
    ) -> tuple[Float64[np.ndarray, "m n"], Float64[np.ndarray, " m"]]:
        E = N.dot(self.G)
        np.negative(E, out=E)
        E[:, : self._nr] += T
        return E, r - N.dot(self.c)

    def _rows(
        self, level: list[Assignment]
    ) -> tuple[Float64[np.ndarray, "m nr"], Float64[np.ndarray, "m np"], Float64[np.ndarray, " m"]]:
        """Weighted rows of a level: T, N and r."""
        reduced, part = self._reduced, self._reduced.partition
        m = sum(len(a.second) for a in level)
        T, J_u, r = np.empty((m, self._nr)), np.empty((m, part.nu)), np.empty(m)
        first = 0
        for a in level:
            task, place = a.task, slice(first, first + len(a.second))
            weight = task.weight[a.second]
            jacobian = task.jacobian[a.second] * weight[:, None]
            part.a.columns(jacobian, T[place])
            part.u.columns(jacobian, J_u[place])
            r[place] = weight * (task.reference[a.second] - task.drift[a.second])
            first = place.stop
        T[:, part.na :] = J_u.dot(reduced.Jbar_z)
        return T, J_u.dot(reduced.N_z), r


class _Split(NamedTuple):
    """Complete orthogonal decomposition U T V^T; T is lower triangular, its first pivots strong.

    Attributes:
        U: orthogonal; the first `rank` columns are reached.
        V: orthogonal; the first `rank` columns reach them.
        T1_inverse: inverse of the strong part of T.
        strong: number of strong pivots.
        rank: number of pivots that are not zero.
    """

    U: Float64[np.ndarray, "m m"]
    V: Float64[np.ndarray, "d d"]
    T1_inverse: Float64[np.ndarray, "k k"]
    strong: int
    rank: int


def _split(A: Float64[np.ndarray, "m d"]) -> _Split | None:
    """Splits rows into what their freedom reaches and what it does not; None where A is zero."""
    if not A.size:
        return None
    packed, pivots, tau, _, _ = lapack.dgeqp3(A)
    sizes = np.abs(packed.diagonal())
    rank = int(np.count_nonzero(sizes > RANK_TOLERANCE * sizes[0])) if sizes[0] > 0.0 else 0
    if not rank:
        return None
    unpivoted = np.empty((rank, A.shape[1]))
    unpivoted[:, pivots - 1] = np.triu(packed[:rank])
    U = _orthogonal(packed, tau)
    packed, tau, _, _ = lapack.dgeqrf(unpivoted.T)
    sizes = np.abs(packed.diagonal())
    # A leading block, because T is triangular.
    weak = np.flatnonzero(sizes < WEAK * sizes.max())
    strong = int(weak[0]) if len(weak) else rank
    # unpivoted^T = V S with S upper triangular, so that T = S^T.
    S_inverse = lapack.dtrtri(np.triu(packed[:strong, :strong]), lower=0)[0]
    return _Split(U, _orthogonal(packed, tau), S_inverse.T, strong, rank)


def _orthogonal(
    packed: Float64[np.ndarray, "m d"], tau: Float64[np.ndarray, " k"]
) -> Float64[np.ndarray, "m m"]:
    """The whole orthogonal factor of LAPACK's packed reflectors."""
    m = len(packed)
    square = np.zeros((m, m), order="F")
    square[:, : len(tau)] = packed[:, : len(tau)]
    return lapack.dorgqr(square, tau, overwrite_a=1)[0]
