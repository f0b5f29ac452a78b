"""`OperationalRecursion`: prioritised accelerations, with no projected Jacobian differentiated."""

from math import sqrt

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import (
    MemoryBlock,
    allocate,
    compiled,
    factor,
    factor_leading,
    part,
    say_if_slow,
    solve_leading,
    solve_lower,
    solve_transposed,
    view,
)
from poise.control._osf._rows import BoundRows, LevelRows
from poise.control._rank import PHYSICS_RANK, RankTreatment
from poise.control._row_factor import (
    ROUNDING,
    add_row,
    factor_rows,
    fill_complement,
    keeps_rank,
    turn,
    turn_back,
)
from poise.control._strategy import UNSOFTENED
from poise.dynamics import Dynamics, StateNumbers, reach_of
from poise.robots import Robot
from poise.stack import AT_BOUND


class RecursionMemory(MemoryBlock):
    """Memory of the recursion; it holds until the next state."""

    least: Float64[np.ndarray, "2"]  # singular value of rows that keep their rank: physics, tasks
    dv: Float64[np.ndarray, " n"]  # the answer
    reach: Int64[np.ndarray, " n"]  # end of the coordinates of the joints that hang on each
    U: Float64[np.ndarray, "n n"]  # factor of the mass matrix, M = U U^T
    X: Float64[np.ndarray, "n n"]  # rows J~ = J U^-T of the leading levels, see `_row_factor`
    tau: Float64[np.ndarray, " n"]  # factors of their reflections
    B: Float64[np.ndarray, "n n"]  # accelerations that leave those levels alone, orthonormal by M
    y: Float64[np.ndarray, " n"]  # coordinates that the levels decide: L_J y = target
    S: Float64[np.ndarray, " n"]  # acceleration after the leading levels
    G: Float64[np.ndarray, "n n"]  # scratch
    F: Float64[np.ndarray, "n n"]  # scratch
    z: Float64[np.ndarray, "2 n"]  # scratch


@compiled
def resolve(levels_at: int, state_at: int, memory_at: int) -> tuple[int, bool]:
    """Find the acceleration of one state; return the number of levels of full rank, and if all."""
    levels, state = view(LevelRows, levels_at), view(StateNumbers, state_at)
    memory = view(RecursionMemory, memory_at)
    if not factor(state.M, memory.reach, memory.U):
        memory.U[:] = np.nan
    regular = _factor_levels(levels, memory)
    _add_levels(levels, memory, regular)
    for i in range(len(memory.dv)):
        memory.dv[i] = memory.S[i]
    taken = int(levels.ends[regular])
    if regular == len(levels.ends) - 1:
        _let_go(state.h, memory, taken)
        return regular, True
    fill_complement(memory.B, memory.X, taken, memory.tau)
    for i in range(len(memory.B) - taken):
        solve_transposed(memory.U, memory.reach, memory.B[i])
    # A posture may have more rows than the tasks above leave directions, and lose none.
    return regular, _take_rest(levels, memory, regular)


@compiled
def is_inside(dv: Float64[np.ndarray, " n"], bounds_at: int) -> bool:
    """Return True for an acceleration within its bounds up to `AT_BOUND`, and for NaN."""
    bounds = view(BoundRows, bounds_at)
    base = len(dv) - len(bounds.lower)
    for i in range(len(bounds.lower)):
        value = dv[base + i]
        if value > bounds.upper[i] + AT_BOUND or value < bounds.lower[i] - AT_BOUND:
            return False
    for row in range(len(bounds.least)):
        value = 0.0
        for j in range(len(dv)):
            value += bounds.rows[row, j] * dv[j]
        if value > bounds.most[row] + AT_BOUND or value < bounds.least[row] - AT_BOUND:
            return False
    return True


@part
def _solve_upper(
    U: Float64[np.ndarray, "n n"], reach: Int64[np.ndarray, " n"], x: Float64[np.ndarray, " n"]
) -> None:
    """X <- U^-1 x; zeros at the end of x stay zero and cost nothing."""
    end = len(U)
    while end > 0 and x[end - 1] == 0.0:
        end -= 1
    for i in range(end - 1, -1, -1):
        rest, row = x[i], U[i]
        for k in range(i + 1, min(reach[i], end)):
            rest -= row[k] * x[k]
        x[i] = rest / row[i]


@part
def _factor_levels(levels: LevelRows, memory: RecursionMemory) -> int:
    """Factor the leading levels; return how many keep their rank."""
    n, ends, X, tau = len(memory.U), levels.ends, memory.X, memory.tau
    for level in range(len(levels.softened)):
        levels.softened[level] = 0.0
    for level in range(len(ends) - 1):
        begin, end = int(ends[level]), int(ends[level + 1])
        if end > n:
            return level
        for row in range(begin, end):
            scale = levels.scale[row]
            memory.y[row] = scale * levels.target[row]
            for j in range(n):
                X[row, j] = scale * levels.jacobian[row, j]
            _solve_upper(memory.U, memory.reach, X[row])
        factor_rows(X, begin, end, tau)
        if not keeps_rank(X, begin, end, memory.least[min(level, 1)], memory.G):
            return level
        solve_lower(X, begin, end, memory.y)
        if levels.softening[level] > 0.0:
            _soften(levels, memory, level)
    return len(ends) - 1


@part
def _soften(levels: LevelRows, memory: RecursionMemory, level: int) -> None:
    """Soften a level whose block L_k of the staircase is regular, if that can change it."""
    # With p the joints' acceleration beside the reference in the strict answer, and D that for a
    # unit of each coordinate that the levels above leave, the level's own coordinates change by
    # the x_k of the least squares |W L_k x_k|^2 + mu^2 |D x + p|^2, W = `mobility`; those of the
    # levels below are theirs. Its rows change by mu |p| at most.
    reference = levels.reference
    begin, end, mu = int(levels.ends[level]), int(levels.ends[level + 1]), levels.softening[level]
    D, G, X, x, S = memory.F, memory.G, memory.X, memory.z[1], memory.z[0]
    size, base, strain = len(S) - begin, len(S) - len(reference), 0.0
    _turn_part(memory, 0, end)
    for j in range(len(reference)):
        S[base + j] -= reference[j]
        strain += S[base + j] * S[base + j]
    if mu * sqrt(strain) <= UNSOFTENED:
        return
    levels.softened[level] = mu
    for i in range(size):
        for j in range(len(S)):
            D[i, j] = 0.0
        D[i, begin + i] = 1.0
    turn_back(D, 0, size, X, end, memory.tau)
    for i in range(size):
        solve_transposed(memory.U, memory.reach, D[i])
        own, total = D[i, base:], 0.0
        for k in range(len(own)):
            total += own[k] * S[base + k]
        x[i] = -mu * mu * total
        for j in range(i + 1):
            other, total = D[j, base:], 0.0
            for k in range(len(own)):
                total += own[k] * other[k]
            G[i, j] = mu * mu * total + (ROUNDING if i == j else 0.0)
            for row in range(begin + i, end):
                G[i, j] += levels.mobility[row] ** 2 * X[row, begin + i] * X[row, begin + j]
    factor_leading(G, size)
    solve_leading(G, size, x)
    for row in range(begin, end):
        memory.y[row] += x[row - begin]


@part
def _turn_part(memory: RecursionMemory, begin: int, end: int) -> None:
    """Find the acceleration of some places of y, in the first row of z."""
    z = memory.z
    for i in range(z.shape[1]):
        z[0, i] = memory.y[i] if begin <= i < end else 0.0
    turn_back(z, 0, 1, memory.X, end, memory.tau)
    solve_transposed(memory.U, memory.reach, z[0])


@part
def _add_levels(levels: LevelRows, memory: RecursionMemory, regular: int) -> None:
    """Find S after the leading levels."""
    S, z = memory.S, memory.z
    for i in range(len(S)):
        S[i] = 0.0
    for level in range(regular):
        _turn_part(memory, int(levels.ends[level]), int(levels.ends[level + 1]))
        for i in range(len(S)):
            S[i] += z[0, i]


@part
def _let_go(h: Float64[np.ndarray, " n"], memory: RecursionMemory, taken: int) -> None:
    """Leave directions that no level decides without force: dv <- dv - N M^-1 h."""
    z = memory.z
    for i in range(len(h)):
        z[0, i] = h[i]
    _solve_upper(memory.U, memory.reach, z[0])
    turn(z, 0, 1, memory.X, 0, taken, memory.tau)
    for i in range(taken):
        z[0, i] = 0.0
    turn_back(z, 0, 1, memory.X, taken, memory.tau)
    solve_transposed(memory.U, memory.reach, z[0])
    for i in range(len(h)):
        memory.dv[i] -= z[0, i]


@part
def _take_rest(levels: LevelRows, memory: RecursionMemory, level: int) -> bool:
    """Give a level all remaining directions by least squares, if it loses none of them."""
    # With A = J B and c = target - J S it adds B (A^T A)^-1 A^T c; later levels find nothing.
    dv = memory.dv
    begin, end = int(levels.ends[level]), int(levels.ends[level + 1])
    left, G, F, z = len(dv) - begin, memory.G, memory.F, memory.z
    if end - begin < left or levels.may_soften[level] == 1:
        return False
    _square(levels, memory, begin, end, left)
    least = memory.least[min(level, 1)]
    for i in range(left):
        for j in range(i):
            F[i, j] = G[i, j]
        F[i, i] = G[i, i] - least * least
    if not (factor_leading(F, left) and factor_leading(G, left)):
        return False
    x = z[1]
    solve_leading(G, left, x)
    for j in range(len(dv)):
        step = 0.0
        for i in range(left):
            step += x[i] * memory.B[i, j]
        dv[j] += step
    return True


@part
def _square(levels: LevelRows, memory: RecursionMemory, begin: int, end: int, left: int) -> None:
    """Find G = A^T A, in its lower triangle, and z[1] = A^T c, row by row of A."""
    S, G, a, total = memory.S, memory.G, memory.z[0], memory.z[1]
    for i in range(left):
        total[i] = 0.0
        for j in range(i + 1):
            G[i, j] = 0.0
    for row in range(begin, end):
        J, scale, c = levels.jacobian[row], levels.scale[row], levels.target[row]
        for k in range(len(S)):
            c -= J[k] * S[k]
        for i in range(left):
            direction, a[i] = memory.B[i], 0.0
            for k in range(len(S)):
                a[i] += J[k] * direction[k]
        add_row(G, total, a, left, scale * scale, c)


class OperationalRecursion:
    """The operational space formulation with its bias velocity terms cancelled.

    With N_1 = I, J_i|p = J_i N_i, Jbar_i = M^-1 J_i|p^T Lambda_i|p and N_i+1 = N_i - Jbar_i J_i|p
    as in eqs (5) to (8) of (Park, Jin, Kang 2022), the sum of the torques (17) under the bias
    acceleration (23) or (31) is

        alpha_i = xdd_i,ref - Jdot_i v - J_i S_i-1        S_0 = 0
        S_i     = S_i-1 + Jbar_i alpha_i
        Gamma   = M S_k + h - N_k+1^T h                   h = V + G

    because alpha_i equals xdd_i|p,ref - Jdot_i|p v: the terms of the projected Jacobian's
    derivative in the bias acceleration and in mu_i|p cancel.

    With M = U U^T and rows J~ = J U^-T, all projections are orthogonal ones. Levels that the robot
    can follow without loss of rank need no projector at all: their stacked rows are J~ = [L_J 0] Q,
    the squares of L_J's diagonal blocks are the Lambda_i|p^-1, and the recursion above is the
    substitution with L_J. From the first level that loses rank on, levels are taken one by one in
    the basis of their null space, with the activations of `RankTreatment`; both ways give the same
    numbers where both apply. The first way is compiled.

    Rows are scaled by w, `LevelRows.scale`, in which they are about one where a task moves freely.
    A level that cannot be met takes, of what the levels above leave, the least squares of its
    scaled rows. One that is softened by mu > 0 takes, over the directions of its rows,

        min |W (J_i dv - target_i)|^2 + mu^2 |dv_J - d|^2

    with the weights W of its tasks and the joint accelerations d of `Softening`, and keeps all
    these directions: the null space for the levels below does not depend on mu. Where it loses rank
    without having an error, mu is `RankTreatment.damp` of its rows.

    Attributes:
        regular: number of leading levels that kept their rank at the last state.
    """

    def __init__(self, robot: Robot, rank: RankTreatment) -> None:
        self._rank, self.regular = rank, 0
        least = np.array([PHYSICS_RANK.high, rank.high])
        reach = reach_of(robot, np.arange(robot.nv))
        self._memory = allocate(RecursionMemory, {"n": robot.nv, "2": 2}, least=least, reach=reach)
        # The first tick of a controller is rehearsed, and compiles.
        say_if_slow(resolve, "operational space control")

    def resolve(self, levels: LevelRows, dynamics: Dynamics) -> Float64[np.ndarray, " n"]:
        """Return the acceleration of one state.

        Directions that no level decides are left without force: they accelerate by -M^-1 h.
        """
        memory = self._memory
        self.regular, done = resolve(levels.address, dynamics.numbers.address, memory.address)
        return memory.dv.copy() if done else self._take_tail(levels, dynamics.h)

    def _take_tail(
        self, levels: LevelRows, h: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, " n"]:
        """Return the acceleration with the levels from the first on that lost rank."""
        S, reference = self._memory.S.copy(), levels.reference
        left = len(S) - int(levels.ends[self.regular])
        basis = self._memory.B[:left].T
        # N in the mass metric, in coordinates of the basis.
        N = np.eye(left)
        for i, level in enumerate(levels.slices[self.regular :], start=self.regular):
            scale = levels.scale[level]
            rows, target = levels.jacobian[level] * scale[:, None], levels.target[level] * scale
            A = (rows @ basis) @ N
            squares, V = np.linalg.eigh(A.T @ A)
            missing, motion = target - rows @ S, basis @ V
            if levels.may_soften[i]:
                activation, _ = PHYSICS_RANK.activate(squares)
                W, D = levels.mobility[level][:, None], motion[-len(reference) :]
                least = float(squares[activation > 0.0].min(initial=np.inf))
                square = float(levels.softening[i]) ** 2
                square += (self._rank.damp(least) * float(W.min(initial=np.inf))) ** 2
                levels.softened[i] = np.sqrt(square)
                own, off = W * (A @ V), S[-len(reference) :] - reference
                H = own.T @ own + square * D.T @ D + ROUNDING * np.eye(left)
                wanted = own.T @ (W[:, 0] * missing) - square * D.T @ off
                step = activation * np.linalg.solve(H, wanted)
            else:
                activation, gain = (self._rank if i else PHYSICS_RANK).activate(squares)
                step = gain * (V.T @ (A.T @ missing))
            S = S + motion @ step
            N -= (V * activation) @ V.T
        # What no level decides has no force.
        return S - basis @ (N @ (basis.T @ h))
