"""`Softening`: weights and reference of the softening terms of a stack's levels."""

from collections.abc import Sequence
from math import sqrt

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock, compiled, view
from poise.robots import Robot
from poise.stack._joints import JointTask
from poise.stack._tables import Rows
from poise.stack._task import Task

DAMPING = 10.0
"""Damping of joints that no joint task refers to [1/s]: that of the default `PostureTask`."""


class Terms(MemoryBlock):
    """Inputs and outputs of `find_softening`.

    Attributes:
        target: right-hand sides of the stack's rows.
        error: their errors.
        weight: their weights.
        row_of: row of the joint task that refers to each joint, -1 for none.
        spans: first row of each level that may be softened, and the row after its last.
        settings: the stack's `softening`; damping of joints without a joint task [1/s].
        weights: receives mu of each of these levels.
        reference: receives d of each joint [rad/s^2, rad/s].
    """

    target: Float64[np.ndarray, " m"]
    error: Float64[np.ndarray, " m"]
    weight: Float64[np.ndarray, " m"]
    row_of: Int64[np.ndarray, " j"]
    spans: Int64[np.ndarray, "s two"]
    settings: Float64[np.ndarray, " two"]
    weights: Float64[np.ndarray, " s"]
    reference: Float64[np.ndarray, " j"]


class Softening:
    """Softening terms `mu_k^2 |dv_J - d|^2` of a stack's levels, see `poise.hqp.SoftenedSolver`.

    With e_k the errors of a level's tasks [m, rad] and w_k the weights of their rows,

        mu_k^2 = |w_k e_k|^2 s / (s + |e_k|),

    s being the stack's `softening`. So a level without error is strict, and near its target mu_k is
    the error itself, as in Sugihara, "Solvability-unconcerned inverse kinematics by the
    Levenberg-Marquardt method" (T-RO 2011). Far away the square grows with the error, because so
    does the stiffness that a target out of reach has along a singular direction of lever c [m]:

        c kp |e_k| / mu_k^2 = c kp (1 / s + 1 / |e_k|).

    Errors count up to one metre or radian. The reference d of a joint is the reference acceleration
    of the lowest joint task that has the joint, and damping -`DAMPING` v where there is none.

    Attributes:
        levels: indices of the levels that may be softened: those with rows that do not refer to
            every joint.
        exact: whether all that follows the last of them is one joint task of all joints.
        terms: weights and reference, as `find_softening` left them.
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
        self._row_of = np.full(robot.nj, -1, dtype=np.int64)
        for level in levels:
            for task in level:
                if isinstance(task, JointTask):
                    place = rows[task]
                    self._row_of[task.chosen - robot.base_dofs] = np.arange(place.start, place.stop)
        self.levels = (
            [i for i, level in enumerate(levels) if level and not _refers_to_all(level, robot)]
            if softening > 0.0
            else []
        )
        below = levels[self.levels[-1] + 1 :] if self.levels else ()
        self.exact = len(below) == 1 and len(below[0]) == 1 and _refers_to_all(below[0], robot)
        self._spans = np.array(
            [(int(ends[i]), int(ends[i + 1])) for i in self.levels], dtype=np.int64
        ).reshape(-1, 2)
        self._settings = np.array([softening, DAMPING])

    def read_from(self, rows: Rows, *, velocities: bool = False) -> None:
        """Read the rows of a stack from now on."""
        self._settings[1] = 0.0 if velocities else DAMPING
        self.terms = Terms(
            target=rows.target,
            error=rows.error,
            weight=rows.weight,
            row_of=self._row_of,
            spans=self._spans,
            settings=self._settings,
            weights=np.zeros(len(self.levels)),
            reference=np.zeros(len(self._row_of)),
        )
        # What is compiled is compiled now, not in the first tick.
        self.find(np.zeros(len(self._row_of)), np.zeros(len(self._row_of)), 0)

    def find(
        self, v: Float64[np.ndarray, " nv"], x: Float64[np.ndarray, " n"], first: int
    ) -> float:
        """Find `terms` for the rows as they are, see `find_softening`."""
        return find_softening(self.terms.address, v, x, first)

    def by_level(self, weights: Float64[np.ndarray, " s"]) -> dict[int, float]:
        """Return the weights that are not zero, by the index of their level."""
        return {k: mu for k, mu in zip(self.levels, weights.tolist(), strict=False) if mu > 0.0}


def _refers_to_all(level: Sequence[Task], robot: Robot) -> bool:
    """Return whether joint tasks of a level refer to every joint of the robot."""
    joints = {j for task in level if isinstance(task, JointTask) for j in task.chosen.tolist()}
    return len(joints) == robot.nj


@compiled
def find_softening(
    terms_at: int, v: Float64[np.ndarray, " nv"], x: Float64[np.ndarray, " n"], first: int
) -> float:
    """Write weights and reference of the softening terms of evaluated rows."""
    terms = view(Terms, terms_at)
    most, reference, base = 0.0, terms.reference, len(v) - len(terms.reference)
    for k in range(len(terms.spans)):
        square = weighted = 0.0
        for i in range(terms.spans[k, 0], terms.spans[k, 1]):
            error = terms.error[i]
            square += error * error
            weighted += (terms.weight[i] * error) ** 2
        softening, size, weight = terms.settings[0], sqrt(square), 0.0
        if size > 0.0:
            counted = min(size, 1.0)
            weight = sqrt(weighted) / size * counted * sqrt(softening / (softening + counted))
        # What is no number softens nothing.
        terms.weights[k] = weight if weight < np.inf else 0.0
        most = max(most, terms.weights[k])
    strain = 0.0
    for j in range(len(reference)):
        row = terms.row_of[j]
        reference[j] = terms.target[row] if row >= 0 else -terms.settings[1] * v[base + j]
        off = x[first + j] - reference[j]
        strain += off * off
    return most * sqrt(strain)
