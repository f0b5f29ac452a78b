"""`TaskRows`: the rows of all tasks in one stack, and which of the two problems each is for.

`Assignment`: which rows of a task LQP 1 can meet, and which only LQP 2.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled
from poise.dynamics import Dynamics, Partition
from poise.robots import Robot
from poise.stack import ComTask, FrameTask, JointTask, MomentumTask, RelativeFrameTask, Task


@dataclass(frozen=True, kw_only=True, eq=False)
class Assignment:
    """Where the rows of one task go, section 3.4 of Ahn et al. 2024.

    Attributes:
        task: the task.
        first: rows that the reduced robot decides: LQP 1.
        second: rows that need the unconstrained chain's own joints: LQP 2, which knows the rest.
        through_centroids: whether the first rows move with the centroids, too.
    """

    task: Task
    first: Int64[np.ndarray, " m1"]
    second: Int64[np.ndarray, " m2"]
    through_centroids: bool = False


def assign(task: Task, robot: Robot, partition: Partition) -> Assignment:
    """Assigns the rows of a task by what they need, without asking the user.

    - COM and momentum need the unconstrained chain through its centroids only: LQP 1 (22).
    - A frame that no joint of the unconstrained chain moves, and a frame seen from another where
      no such joint stands between the two: LQP 1.
    - Other frames: LQP 2, with the acceleration of everything else known (23).
    - A task of joints is split, joint by joint.
    - A kind of task that is not known here: LQP 2. What of its rows the chain's own joints cannot
      decide `ChainElimination` leaves to LQP 1, which may be all of them.

    Args:
        task: a task bound to the robot.
        robot: the robot.
        partition: its chains.
    """
    rows, none = np.arange(task.dim), np.arange(0)
    if isinstance(task, ComTask | MomentumTask):
        return Assignment(task=task, first=rows, second=none, through_centroids=True)
    if isinstance(task, JointTask):
        names = robot.joint_names if task.joints is None else task.joints
        free = set(partition.unconstrained)
        in_u = np.array([name in free for name in names], dtype=np.bool_)
        return Assignment(task=task, first=rows[~in_u], second=rows[in_u])
    if isinstance(task, FrameTask):
        needed = _movers(robot, task.frame)
    elif isinstance(task, RelativeFrameTask):
        needed = _movers(robot, task.frame) ^ _movers(robot, task.root)
    else:
        # Nothing is known of it but its rows, which may need anything.
        needed = set(range(robot.nv))
    if needed & set(partition.u.index.tolist()):
        return Assignment(task=task, first=none, second=rows)
    return Assignment(task=task, first=rows, second=none)


def _movers(robot: Robot, frame: str) -> set[int]:
    """Coordinates that move a frame in the world."""
    model = robot.model
    joints = model.supports[model.frames[robot.frame_id(frame)].parentJoint].tolist()
    return {model.idx_vs[j] + k for j in joints if j > 0 for k in range(model.nvs[j])}


class TaskRows:
    """Rows J dv = target of the tasks that act, level by level, one below the other.

    Args:
        nv: size of the velocity vector.
        levels: the tasks that act, with what each of their rows needs.

    Attributes:
        J: coefficients of dv.
        target: reference - drift.
        weight: of each row in its level.
        ends: where each level ends; the first entry is zero.
        levels: the same tasks.
        first: the rows that LQP 1 decides.
        centroid: those of them that move with the centroids.
        second: the rows that need the unconstrained chain's own joints.
        second_ends: where each level ends among those; the first entry is zero.
    """

    def __init__(self, nv: int, levels: Sequence[Sequence[Assignment]]) -> None:
        self.levels = tuple(tuple(level) for level in levels)
        sizes = [sum(a.task.dim for a in level) for level in levels]
        self.ends: Int64[np.ndarray, " levels+1"] = np.array([0, *accumulate(sizes)])
        m = int(self.ends[-1])
        self.J: Float64[np.ndarray, "m nv"] = np.zeros((m, nv))
        self.target: Float64[np.ndarray, " m"] = np.zeros(m)
        self.weight: Float64[np.ndarray, " m"] = np.ones(m)
        self._missing = np.zeros(m)
        self._residuals = np.zeros(len(sizes))
        self._placed: list[_Placed] = []
        first: list[int] = []
        second: list[int] = []
        centroid: list[int] = []
        second_ends, row = [0], 0
        for level in levels:
            for a in level:
                place = slice(row, row + a.task.dim)
                self.weight[place] = a.task.weight
                self._placed.append((a, self.J[place], self.target[place], place))
                first += (row + a.first).tolist()
                centroid += (row + a.first).tolist() if a.through_centroids else []
                second += (row + a.second).tolist()
                row = place.stop
            second_ends.append(len(second))
        self.first, self.centroid, self.second, self.second_ends = (
            np.array(index, dtype=np.int64) for index in (first, centroid, second, second_ends)
        )

    def update(self, dynamics: Dynamics) -> None:
        """Evaluates the tasks for a state.

        Args:
            dynamics: the state, up to date.
        """
        for assignment, jacobian, target, _ in self._placed:
            task = assignment.task
            task.evaluate(dynamics)
            jacobian[:] = task.jacobian
            np.subtract(task.reference, task.drift, out=target)

    def measure(self, dv: Float64[np.ndarray, " nv"]) -> Float64[np.ndarray, " levels"]:
        """What an acceleration leaves over of each level, relative to its scale.

        Args:
            dv: generalized acceleration.

        Returns:
            |W (J dv - target)| / max(1, |W target|) of each level; overwritten by the next call.
        """
        _measure(self.J, self.target, self.weight, self.ends, dv, self._missing, self._residuals)
        return self._residuals

    def missing(self) -> dict[str, float]:
        """Norm of what each task could not meet when last measured, by its name."""
        return {
            a.task.name: float(np.linalg.norm(self._missing[place]))
            for a, _, _, place in self._placed
        }


_Placed = tuple[Assignment, Float64[np.ndarray, "m nv"], Float64[np.ndarray, " m"], slice]


@compiled
def _measure(
    J: Float64[np.ndarray, "m nv"],
    target: Float64[np.ndarray, " m"],
    weight: Float64[np.ndarray, " m"],
    ends: Int64[np.ndarray, " k"],
    dv: Float64[np.ndarray, " nv"],
    missing: Float64[np.ndarray, " m"],
    residuals: Float64[np.ndarray, " levels"],
) -> None:
    for level in range(len(residuals)):
        left = asked = 0.0
        for row in range(ends[level], ends[level + 1]):
            value = -target[row]
            for i in range(len(dv)):
                value += J[row, i] * dv[i]
            missing[row] = value
            left += (weight[row] * value) ** 2
            asked += (weight[row] * target[row]) ** 2
        residuals[level] = np.sqrt(left) / max(1.0, np.sqrt(asked))
