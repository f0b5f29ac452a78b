"""`AssignedRows`: assignment of the rows of a stack to LQP 1 and LQP 2."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from poise.dynamics import Partition
from poise.robots import Robot
from poise.stack import (
    BalanceRows,
    ComTask,
    FrameTask,
    JointTask,
    MomentumTask,
    RelativeFrameTask,
    StackRows,
    Task,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Assignment:
    """Assignment of the rows of one task, section 3.4 of Ahn et al. 2024."""

    task: Task | BalanceRows
    first: Int64[np.ndarray, " m1"]  # rows that the reduced robot decides: LQP 1
    second: Int64[np.ndarray, " m2"]  # rows that need the unconstrained chain's joints: LQP 2
    through_centroids: bool = False  # the first rows move with the centroids, too
    movers: tuple[set[int], ...] = ()  # coordinates of `v` that may move each of the second rows


def assign(task: Task, robot: Robot, partition: Partition) -> Assignment:
    """Assign the rows of a task by the joints that they depend on.

    - CoM and momentum need the unconstrained chain through its centroids only: LQP 1 (22).
    - A frame that no joint of the unconstrained chain moves, and a frame relative to another where
      no such joint stands between the two: LQP 1.
    - Other frames: LQP 2, with the acceleration of everything else known (23).
    - A task of joints is split, joint by joint.
    - Any other kind of task: LQP 2. `ChainElimination` leaves rows, perhaps all, to LQP 1 that the
      chain's own joints cannot decide.
    """
    rows, none = np.arange(task.dim), np.arange(0)
    if isinstance(task, ComTask | MomentumTask):
        return Assignment(task=task, first=rows, second=none, through_centroids=True)
    if isinstance(task, JointTask):
        names = robot.joint_names if task.joints is None else task.joints
        moved = [robot.base_dofs + robot.joint_index(name) for name in names]
        in_u = np.isin(moved, partition.u)
        movers = tuple({moved[row]} for row in rows[in_u])
        return Assignment(task=task, first=rows[~in_u], second=rows[in_u], movers=movers)
    if isinstance(task, FrameTask):
        needed = _movers(robot, task.frame)
    elif isinstance(task, RelativeFrameTask):
        needed = _movers(robot, task.frame) ^ _movers(robot, task.root)
    else:
        # Its rows may depend on anything.
        needed = set(range(robot.nv))
    if needed & set(partition.u.tolist()):
        return Assignment(task=task, first=none, second=rows, movers=(needed,) * task.dim)
    return Assignment(task=task, first=rows, second=none)


def _movers(robot: Robot, frame: str) -> set[int]:
    """Find the coordinates that move a frame in the world."""
    model = robot.model
    joints = robot.joints_above(frame)
    return {model.idx_vs[j] + k for j in joints for k in range(model.nvs[j])}


class AssignedRows:
    """The rows of a stack for the two problems.

    Attributes:
        stack_rows: the rows of the stack.
        J: coefficients of dv of their rows, level by level.
        target: their right-hand sides, reference - drift; lower bounds of the balance limit.
        upper: the same, but for the upper bounds of the balance limit.
        weight: of each row in its level.
        levels: assignments of the tasks that act, level by level; the balance limit first, where
            there is one.
        first: the rows that LQP 1 decides.
        centroid: those of them that move with the centroids.
        second: the rows that need the unconstrained chain's own joints.
        second_ends: where each level ends among those; the first entry is zero.
        seen: places in `a` of the coordinates that may move any of them.
        moving: places in `u` of the coordinates that may move each of them, one after the other.
        moving_ends: where those of each end; the first entry is zero.
    """

    def __init__(self, rows: StackRows, robot: Robot, partition: Partition) -> None:
        self.stack_rows = rows
        tasks = slice(rows.own_rows.stop, int(rows.ends[-1]))
        self.J, self.target, self.weight = rows.J[tasks], rows.target[tasks], rows.weight[tasks]
        self.upper = rows.upper[tasks]
        self.levels = tuple(
            tuple(assign(task, robot, partition) for task in level) for level in rows.levels
        )
        if rows.balance is not None:
            # CoM, momentum, and legs that stand: through the centroids, and nothing but them.
            index = np.arange(rows.balance.dim)
            balance = Assignment(
                task=rows.balance, first=index, second=index[:0], through_centroids=True
            )
            self.levels = ((balance,), *self.levels)
        first: list[int] = []
        second: list[int] = []
        centroid: list[int] = []
        movers: list[set[int]] = []
        second_ends, row = [0], 0
        for level in self.levels:
            for a in level:
                first += (row + a.first).tolist()
                centroid += (row + a.first).tolist() if a.through_centroids else []
                second += (row + a.second).tolist()
                movers += a.movers
                row += a.task.dim
            second_ends.append(len(second))
        self.first, self.centroid, self.second, self.second_ends = (
            np.array(index, dtype=np.int64) for index in (first, centroid, second, second_ends)
        )
        self.seen: Int64[np.ndarray, " seen"] = np.flatnonzero(
            np.isin(partition.a, sorted(set().union(*movers)))
        )
        moving = [np.flatnonzero(np.isin(partition.u, sorted(own))) for own in movers]
        self.moving: Int64[np.ndarray, " k"] = np.concatenate([np.arange(0), *moving])
        self.moving_ends: Int64[np.ndarray, " ends"] = np.cumsum([0, *map(len, moving)])
