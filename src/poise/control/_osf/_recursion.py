"""`OperationalRecursion`: prioritised accelerations, with no projected Jacobian differentiated."""

import numpy as np
from jaxtyping import Float64

from poise._compiled import allocate, say_if_slow
from poise.control._osf._kernels import TINY, RecursionMemory, resolve
from poise.control._osf._rows import LevelRows
from poise.control._rank import PHYSICS_RANK, RankTreatment
from poise.dynamics import Dynamics, reach_of
from poise.robots import Robot


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
                H = own.T @ own + square * D.T @ D + TINY * np.eye(left)
                wanted = own.T @ (W[:, 0] * missing) - square * D.T @ off
                step = activation * np.linalg.solve(H, wanted)
            else:
                activation, gain = (self._rank if i else PHYSICS_RANK).activate(squares)
                step = gain * (V.T @ (A.T @ missing))
            S = S + motion @ step
            N -= (V * activation) @ V.T
        # What no level decides has no force.
        return S - basis @ (N @ (basis.T @ h))
