"""`solve_levels`: prioritised differential inverse kinematics in closed form.

`ClosedForm`: the same with memory of its own, for many ticks.
Inverses of one level's rows: the right inverse (22c), and the SR-inverse (22e).
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from poise.control._differential_ik._kernels import (
    VelocityLevel,
    VelocityLevels,
    drop_rounding,
    make_work,
    serve_levels,
)
from poise.control._rank import RankTreatment


def right_inverse(
    jacobian: Float64[np.ndarray, "m n"],
    velocity: Float64[np.ndarray, " m"],
    scale: Float64[np.ndarray, " m"],
    rank: RankTreatment,
) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, "n n"]]:
    """Least step that gives a velocity, J^+ v with J^+ = J^T (J J^T)^-1, and the space it fills.

    Equation (22c) of Zhang and Kikuuwe, which has no answer where J J^T cannot be inverted. There,
    directions get the activation that `rank` gives them, from one down to zero.
    """
    rows, scaled = jacobian * scale[:, None], velocity * scale
    squares, directions = np.linalg.eigh(rows @ rows.T)
    _, gain = rank.activate(squares)
    turned = directions.T @ rows
    inverse = turned.T * gain
    return inverse @ (directions.T @ scaled), inverse @ turned


def robust_step(
    jacobian: Float64[np.ndarray, "m n"],
    velocity: Float64[np.ndarray, " m"],
    weight: Float64[np.ndarray, " m"],
) -> Float64[np.ndarray, " n"]:
    """The step J^# v of the singularity-robust inverse J^# = (J^T W J + I)^-1 J^T W.

    Equation (22e) of Zhang and Kikuuwe: it minimises |J x - v|^2_W + |x|^2, so that |x| is at most
    sqrt(w) |v| / 2 for a weight w, singular or not. It is found as B^T (B B^T + I)^-1 sqrt(W) v
    with B = sqrt(W) J, which is the same.
    """
    root = np.sqrt(weight)
    rows = jacobian * root[:, None]
    gram = rows @ rows.T
    gram.flat[:: len(root) + 1] += 1.0
    return rows.T @ np.linalg.solve(gram, root * velocity)


RANK = RankTreatment(low=0.005, high=0.02)
"""Rank treatment of velocities: exact to within a fiftieth of the mobility in the home posture.

Closer to singularities than accelerations are followed, because velocities are bounded afterwards
and nothing is divided by them again."""


def solve_levels(
    levels: Sequence[VelocityLevel],
    joint_weight: Float64[np.ndarray, " n"],
    *,
    exact: int = 1,
    rank: RankTreatment = RANK,
) -> Float64[np.ndarray, " n"]:
    """Joint velocities that serve levels in strict order.

    For two levels, one of them exact, this is (21) with (22) of Zhang and Kikuuwe, "COM Shifter and
    Body Rotator for Step-by-Step Teleoperation of Bipedal Robots", which solves

        min |J_2 u - v_2|^2_WA + |u|^2_WB    subject to J_1 u = v_1                         (20)

    With more levels each does the same over what those above leave it: in z = W_B^1/2 u, with
    A_i = J_i W_B^-1/2 N_i and r_i = v_i - J_i W_B^-1/2 z,

        z <- z + N_i A_i^+ r_i  or  z + N_i A_i^# r_i        N_i+1 = N_i (I - A_i^+ A_i)

    where the first `exact` levels take the right inverse and the others the SR-inverse. What the
    SR-inverse leaves of its level is not filled by those below.
    """
    form = ClosedForm(len(joint_weight), exact, rank)
    return form.solve(VelocityLevels.of(levels), joint_weight)


class ClosedForm:
    """`solve_levels` with memory of its own.

    With rows J_i W_B^-1/2 one below the other as [L 0] Q, no projector is needed: (22c) is the
    substitution with L, and (22e) is about L's diagonal blocks. From the first level that loses
    rank on, levels are taken one by one by projectors and the eigenvalues of their rows; both ways
    give the same numbers where both apply. The first way is compiled.

    Attributes:
        exact: as given.
        rank: as given.
        work: the memory.
    """

    def __init__(self, n: int, exact: int, rank: RankTreatment) -> None:
        self.exact, self.rank, self.work = exact, rank, make_work(n)
        # What is compiled is compiled now, not in the first tick.
        drop_rounding(self.solve(VelocityLevels.nothing(n), np.ones(n)))

    def solve(
        self, levels: VelocityLevels, joint_weight: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, " n"]:
        """Joint velocities u [rad/s], see `solve_levels`."""
        u = np.empty(len(joint_weight))
        served, taken = serve_levels(levels, joint_weight, self.exact, self.rank.high, self.work, u)
        if served == len(levels.ends) - 1:
            return u
        return self._serve_lost(levels, served, taken)

    def _serve_lost(
        self, levels: VelocityLevels, served: int, taken: int
    ) -> Float64[np.ndarray, " n"]:
        """Serves the levels from the first one that lost rank on."""
        shrink, z = self.work.shrink, self.work.z[0].copy()
        basis = self.work.B[: len(z) - taken]
        N, count = basis.T @ basis, len(levels.ends) - 1
        for i in range(served, count):
            level = levels.level(i)
            if not len(level.velocity):
                continue
            jacobian = level.jacobian * shrink
            rows, missing = jacobian @ N, level.velocity - jacobian @ z
            if i >= self.exact:
                z += N @ robust_step(rows, missing, level.weight)
            if i < self.exact or i < count - 1:
                step, filled = right_inverse(rows, missing, level.scale, self.rank)
                z += N @ step if i < self.exact else 0.0
                N = N - N @ filled
        u = shrink * z
        drop_rounding(u)
        return u
