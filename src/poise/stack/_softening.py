"""`Softening`: weights and reference of the softening terms of a stack's levels."""

from collections.abc import Sequence
from math import sqrt

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled
from poise.robots import Robot
from poise.stack._joints import JointTask
from poise.stack._tables import Rows
from poise.stack._task import Task

DAMPING = 10.0
"""Damping of joints that no joint task refers to [1/s]: that of the default `PostureTask`."""


class Softening:
    """Softening terms `mu_k^2 |dv_J - d|^2` of a stack's levels, see `poise.hqp.SoftenedSolver`.

    With e_k the errors of a level's tasks and w_k the weights of their rows,

        mu_k = |w_k e_k| min(1, s / |e_k|),

    s being the stack's `softening`. So a level without error is strict, the term grows with the
    error, and it saturates relative to the level's own weights (error-proportional damping:
    Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method",
    T-RO 2011). The reference d of a joint is the reference acceleration of the lowest joint task
    that has the joint, and damping -`DAMPING` v where there is none.

    Args:
        robot: the robot.
        levels: the tasks that act, level by level.
        places: the rows of each task.
        ends: where each level ends in the rows, after where the first one begins.
        softening: s of the stack; nothing is softened where it is zero.

    Attributes:
        levels: indices of the levels that may be softened: those with rows that do not refer to
            every joint.
        exact: whether all that follows the last of them is one joint task of all joints.
        weights: mu of each of them; as the next, found by `update`.
        reference: d of each joint [rad/s^2, rad/s].
        inputs: what `find_softening` reads.
    """

    def __init__(
        self,
        robot: Robot,
        levels: Sequence[Sequence[Task]],
        places: Sequence[tuple[Task, slice]],
        ends: Int64[np.ndarray, " ends"],
        softening: float,
    ) -> None:
        rows = dict(places)
        row_of = np.full(robot.nj, -1, dtype=np.int64)
        for level in levels:
            for task in level:
                if isinstance(task, JointTask):
                    place = rows[task]
                    row_of[task.chosen - robot.base_dofs] = np.arange(place.start, place.stop)
        self.levels = (
            [i for i, level in enumerate(levels) if level and not _has_all_joints(level, robot)]
            if softening > 0.0
            else []
        )
        below = levels[self.levels[-1] + 1 :] if self.levels else ()
        self.exact = len(below) == 1 and len(below[0]) == 1 and _has_all_joints(below[0], robot)
        spans = [(int(ends[i]), int(ends[i + 1])) for i in self.levels]
        self.inputs = row_of, np.array(spans, dtype=np.int64).reshape(-1, 2), softening
        self.weights: Float64[np.ndarray, " s"] = np.zeros(len(self.levels))
        self.reference: Float64[np.ndarray, " j"] = np.zeros(robot.nj)

    def update(self, rows: Rows, v: Float64[np.ndarray, " nv"], *, velocities: bool) -> None:
        """Find weights and reference for evaluated rows.

        Args:
            rows: of the stack, evaluated.
            v: generalized velocity.
            velocities: whether right-hand sides are velocities, not accelerations.
        """
        if self.levels:
            damping = 0.0 if velocities else DAMPING
            find_softening(rows, v, self.inputs, (self.weights, self.reference), damping)

    def acts_on(self, joints: Float64[np.ndarray, " j"], tolerance: float) -> bool:
        """Return whether a term can change its level by more than a tolerance.

        Args:
            joints: accelerations or velocities of the joints in the strict answer.
            tolerance: [unit of the rows].
        """
        off = joints - self.reference
        strain = sqrt(float(off.dot(off)))
        return any(not weight * strain <= tolerance for weight in self.weights.tolist())

    def by_level(self, weights: Float64[np.ndarray, " s"]) -> dict[int, float]:
        """Return the weights that are not zero, by the index of their level.

        Args:
            weights: of as many of `levels`.
        """
        return {k: mu for k, mu in zip(self.levels, weights.tolist(), strict=False) if mu > 0.0}


def _has_all_joints(level: Sequence[Task], robot: Robot) -> bool:
    return any(isinstance(task, JointTask) and task.dim == robot.nj for task in level)


@compiled
def find_softening(
    rows: Rows,
    v: Float64[np.ndarray, " nv"],
    inputs: tuple[Int64[np.ndarray, " j"], Int64[np.ndarray, "s 2"], float],
    found: tuple[Float64[np.ndarray, " s"], Float64[np.ndarray, " j"]],
    damping: float,
) -> None:
    """Write weights and reference of evaluated rows, see `Softening`.

    Args:
        rows: of the stack, evaluated.
        v: generalized velocity.
        inputs: of a `Softening`.
        found: receives its weights and its reference.
        damping: of joints without a joint task [1/s].
    """
    (row_of, spans, largest), (weights, reference) = inputs, found
    for k in range(len(spans)):
        square = weighted = 0.0
        for i in range(spans[k, 0], spans[k, 1]):
            square += rows.error[i] * rows.error[i]
            weighted += (rows.weight[i] * rows.error[i]) ** 2
        size = sqrt(square)
        weights[k] = sqrt(weighted) * (largest / size if size > largest else 1.0)
        # No number softens nothing.
        if not weights[k] < np.inf:
            weights[k] = 0.0
    base = len(v) - len(reference)
    for j in range(len(reference)):
        reference[j] = rows.target[row_of[j]] if row_of[j] >= 0 else -damping * v[base + j]
