"""`ClosedForm`: prioritised differential inverse kinematics in closed form.

`WithinBounds`: the same with joints held at their bounds, and rows at theirs.
"""

from itertools import count

import numpy as np
from jaxtyping import Bool, Float64

from poise._compiled import allocate
from poise.control._differential_ik._kernels import (
    NO_VELOCITY,
    ClosedFormMemory,
    VelocityLevels,
    serve_levels,
    take_rows,
)
from poise.control._rank import RankTreatment
from poise.control._row_factor import ROUNDING, SLOP

RANK = RankTreatment(low=0.005, high=0.02)
"""Rank treatment of velocities: exact to within a fiftieth of the mobility in the home posture.

Closer to singularities than accelerations are followed, because velocities are bounded afterwards
and nothing is divided by them again."""


def right_inverse(
    jacobian: Float64[np.ndarray, "m n"],
    velocity: Float64[np.ndarray, " m"],
    scale: Float64[np.ndarray, " m"],
    rank: RankTreatment,
) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, "n n"]]:
    """Return the least step J^+ v, (22c) with directions weighed by `rank`, and the space J^+ J."""
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
    """Return J^# v of (22e), which minimises |J x - v|^2_W + |x|^2: |x| <= sqrt(w) |v| / 2."""
    root = np.sqrt(weight)
    rows = jacobian * root[:, None]
    gram = rows @ rows.T
    gram.flat[:: len(root) + 1] += 1.0
    return rows.T @ np.linalg.solve(gram, root * velocity)


class ClosedForm:
    """Joint velocities that serve levels in strict order.

    For two levels, one of them exact, this is (21) with (22) of Zhang and Kikuuwe, "COM Shifter and
    Body Rotator for Step-by-Step Teleoperation of Bipedal Robots", which solves

        min |J_2 u - v_2|^2_WA + |u|^2_WB    subject to J_1 u = v_1                         (20)

    With more levels each does the same over what those above leave it: in z = W_B^1/2 u, with
    A_i = J_i W_B^-1/2 N_i and r_i = v_i - J_i W_B^-1/2 z,

        z <- z + N_i A_i^+ r_i  or  z + N_i A_i^# r_i        N_i+1 = N_i (I - A_i^+ A_i)

    where exact levels take the right inverse and the others the SR-inverse. What the SR-inverse
    leaves of its level is not filled by those below.

    With rows J_i W_B^-1/2 one below the other as [L 0] Q, no projector is needed: (22c) is the
    substitution with L, and (22e) is about L's diagonal blocks. From the first level that loses
    rank on, levels are taken one by one by projectors and the eigenvalues of their rows; both ways
    give the same numbers where both apply. The first way is compiled.
    """

    def __init__(self, n: int, rank: RankTreatment) -> None:
        self._rank = rank
        sizes = {"n": n, "3": 3, "t": 0, "served": 0, "ends": 1, "limits": 0}
        self.memory = allocate(ClosedFormMemory, sizes, least=np.array([rank.high]))
        # What is compiled is compiled now, not in the first tick.
        nothing = allocate(VelocityLevels, sizes)
        self.solve(nothing, np.ones(n))
        take_rows(nothing.address, nothing.address, self.memory.address, 0)

    def solve(
        self,
        levels: VelocityLevels,
        joint_weight: Float64[np.ndarray, " n"],
        *,
        count: int | None = None,
        fixed: Float64[np.ndarray, " n"] | float = 0.0,
    ) -> Float64[np.ndarray, " n"]:
        """Return the velocities [rad/s] that the first levels add to those of held joints."""
        memory = self.memory
        memory.joint_weight[:], memory.fixed[:] = joint_weight, fixed
        memory.count = len(levels.ends) - 1 if count is None else count
        served = serve_levels(levels.address, memory.address)
        return memory.u.copy() if served == memory.count else self._serve_lost(levels, served)

    def take_rows(
        self,
        levels: VelocityLevels,
        joined: VelocityLevels,
        joint_weight: Float64[np.ndarray, " n"],
        u: Float64[np.ndarray, " n"],
        taken: int,
    ) -> int:
        """Take rows that `u` breaks up into `joined`; return how many it has then."""
        memory = self.memory
        memory.joint_weight[:], memory.fixed[:], memory.u[:] = joint_weight, 0.0, u
        return take_rows(levels.address, joined.address, memory.address, taken)

    def _serve_lost(self, levels: VelocityLevels, served: int) -> Float64[np.ndarray, " n"]:
        """Serve the levels from the first one that lost rank on."""
        memory = self.memory
        shrink, z, count = memory.shrink, memory.z[0].copy(), memory.count
        basis = memory.B[: len(z) - int(levels.ends[served])]
        N = basis.T @ basis
        for i in range(served, count):
            level = levels.level(i)
            if not len(level.velocity):
                continue
            jacobian = level.jacobian * shrink
            rows = jacobian @ N
            missing = level.velocity - level.jacobian @ memory.fixed - jacobian @ z
            if i >= levels.exact:
                z += N @ robust_step(rows, missing, level.weight)
            if i < levels.exact or i < count - 1:
                step, filled = right_inverse(rows, missing, level.scale, self._rank)
                z += N @ step if i < levels.exact else 0.0
                N = N - N @ filled
        u = shrink * z
        size = np.abs(u)
        u[size < ROUNDING * size.max()] = 0.0
        return u


_SINGLY = 5
"""Joints that are held one by one; a joint held too many costs a task near a limit dearly."""

_FAR = 0.5
"""Beyond `_SINGLY`, joints this fraction as far outside as the farthest are held together with it.

One joint a round takes long where many are outside, and there it is not measurably better."""

_MISSED = 1e-3
"""Velocity that the exact levels may miss before lower levels are dropped for them [unit/s].

Two ankles at their limits differ by noise, and the legs' closed chain cannot follow both: nothing
to drop a posture for."""


_Held = tuple[Float64[np.ndarray, " n"], Bool[np.ndarray, " n"]]
"""Joint velocities, and which joints are held at their bounds."""


class WithinBounds:
    """Levels in closed form with joint velocities inside their bounds.

    Where joints would leave their bounds, those farthest outside are held at their bounds and the
    others make up for them, level by level, until none is outside. Where that costs the exact
    levels something, levels are dropped from the bottom up for as long as it helps. Where even the
    first level, the contacts, would be missed, everything else slows down in proportion instead.
    A good answer, not always the best: the hierarchical QP finds that.

    Rows of the self-collision limit that would be broken are held at their bounds, the worst first,
    as one more level below the contacts and above all tasks, until none is broken. Joints' bounds
    come before them: rows without room are missed, and contacts are held all the same.
    """

    def __init__(self, form: ClosedForm) -> None:
        self._form = form

    def solve(
        self,
        levels: VelocityLevels,
        joined: VelocityLevels,
        joint_weight: Float64[np.ndarray, " n"],
        lower: Float64[np.ndarray, " n"],
        upper: Float64[np.ndarray, " n"],
    ) -> _Held:
        """Return the velocities, and which joints are held; `joined` is `levels.with_limits()`."""
        self._joint_weight, self._lower, self._upper = joint_weight, lower, upper
        u, held = self._serve(levels)
        taken = 0
        # Joints that come to rest at their bounds may break other rows.
        for _ in range(3 if len(levels.limits) else 0):
            before = taken
            taken = self._form.take_rows(levels, joined, joint_weight, u, taken)
            if taken == before:
                break
            u, held = self._serve(joined)
        return u, held

    def _serve(self, levels: VelocityLevels) -> _Held:
        depth = len(levels.ends) - 1
        u, held = self._hold(levels, depth)
        if not held.any():
            return u, held
        missed = _missed(levels, levels.exact, u)
        while missed > _MISSED and depth > levels.exact:
            # A lower level may have spent the joints that an exact one needed.
            depth -= 1
            other, other_held = self._hold(levels, depth)
            other_missed = _missed(levels, levels.exact, other)
            if other_missed < missed - _MISSED:
                u, held, missed = other, other_held, other_missed
        if _missed(levels, 1, u) > NO_VELOCITY:
            u = self._slow_down(levels)
        return u, held

    def _hold(self, levels: VelocityLevels, depth: int) -> _Held:
        """Hold joints, those farthest outside first, until the first levels leave none outside."""
        held, fixed = np.zeros(len(self._lower), dtype=np.bool_), np.zeros(len(self._lower))
        u = self._form.solve(levels, self._joint_weight, count=depth)
        for round_ in count():
            outside = np.maximum(u - self._upper, self._lower - u)
            outside[held] = 0.0
            worst = outside.max()
            if not worst > SLOP:
                break
            far = outside >= (worst if round_ < _SINGLY else _FAR * worst)
            held |= far
            fixed[far] = np.where(u > self._upper, self._upper, self._lower)[far]
            weight = np.where(held, np.inf, self._joint_weight)
            u = fixed + self._form.solve(levels, weight, count=depth, fixed=fixed)
        return self._clip(u), held

    def _slow_down(self, levels: VelocityLevels) -> Float64[np.ndarray, " n"]:
        """Move from the solution of the first level towards that of all as far as bounds allow."""
        least, _ = self._hold(levels, 1)
        step = self._form.solve(levels, self._joint_weight) - least
        room = np.where(step > 0.0, self._upper - least, self._lower - least)
        ratio = np.divide(room, step, out=np.ones(len(step)), where=step != 0.0)
        return self._clip(least + min(1.0, float(ratio.min())) * step)

    def _clip(self, u: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        return np.minimum(np.maximum(u, self._lower), self._upper)


def _missed(levels: VelocityLevels, depth: int, u: Float64[np.ndarray, " n"]) -> float:
    """Return the norm of the velocity that the first levels miss."""
    rows = levels.rows[: levels.ends[: depth + 1][-1]]
    missing = levels.velocity[rows] - levels.jacobian[rows] @ u
    return float(np.sqrt(missing.dot(missing)))
