"""`Evaluation`: contacts, tasks and limits of a set, evaluated by one compiled call."""

from collections.abc import Sequence
from itertools import accumulate

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, part, say_if_slow, view
from poise.dynamics import Dynamics, StateNumbers, frames_of
from poise.robots import Robot, once_a_robot
from poise.stack._balance import BalanceRows, bound_balance
from poise.stack._centroid import ComTask, MomentumTask, com_rows, momentum_rows
from poise.stack._contact import Contact, contact_rows
from poise.stack._frame import FrameTask, frame_rows
from poise.stack._joint_limit import Settling, bound_joints, bound_settling
from poise.stack._joints import JointTask, joint_rows
from poise.stack._owner import Owner
from poise.stack._relative_frame import RelativeFrameTask, relative_frame_rows
from poise.stack._self_collision import SelfCollisionRows, bound_self_collision
from poise.stack._support import CORNERS
from poise.stack._tables import (
    GAINS,
    TARGET_ROTATION,
    WORK,
    Line,
    Numbers,
    Owners,
    Rows,
    StackNumbers,
    line_of,
)
from poise.stack._task import Task, feed_back, own_rows

_KINDS = (
    *(Contact, BalanceRows, SelfCollisionRows),
    *(ComTask, MomentumTask, JointTask, FrameTask, RelativeFrameTask),
)
"""Classes with compiled formulas; a task in Python comes after these."""

CONTACT, BALANCE, SELF_COLLISION, COM, MOMENTUM, JOINTS, FRAME, RELATIVE_FRAME = range(len(_KINDS))
OWN = len(_KINDS)


@once_a_robot
def any_dynamics(robot: Robot) -> Dynamics:
    """Dynamics of any state of a robot, for calls that compile."""
    return Dynamics(robot)


def _kind_of(owner: Owner) -> int:
    return next(i for i, kind in enumerate(_KINDS) if isinstance(owner, kind))


class Evaluation:
    """Evaluates contacts, tasks and limits together.

    Attributes:
        rows: what was written.
        owners: contacts, tasks and limits.
        own: those of them that are tasks in Python.
        inputs: of the compiled code.
        assembly: all of it for compiled code.
    """

    def __init__(
        self,
        robot: Robot,
        owners: Sequence[Owner],
        places: Sequence[slice],
        count: int,
        wrench_dim: int,
        compiled: bool = False,
    ) -> None:
        self.owners, self._places, self._nv = tuple(owners), tuple(places), robot.nv
        self.own: list[tuple[Task, slice]] = []
        self._compiled: list[tuple[Owner, slice]] = []
        for owner, place in zip(owners, places, strict=True):
            if isinstance(owner, Task) and not (compiled or owner.is_compiled):
                self.own.append((owner, place))
            else:
                self._compiled.append((owner, place))
        own = {task for task, _ in self.own}
        self._numbers = [Numbers(all=owner.parameters) for owner in owners]
        contacts = sum(isinstance(owner, Contact) for owner in owners)
        lines: list[Line] = []
        chosen: list[int] = []
        start = frames = 0
        for owner, place in zip(owners, places, strict=True):
            kind = OWN if owner in own else _kind_of(owner)
            at, size, root = len(chosen), len(owner.chosen), frames + len(owner.frame_ids) - 1
            where = (kind, place.start, owner.dim, start, frames, root, at, size)
            lines.append(Line(*where, int(owner.turns), int(owner.sine)))
            chosen += [*owner.chosen.tolist(), *accumulate(owner.blocks)]
            start += len(owner.parameters)
            frames += len(owner.frame_ids)
        self.inputs = Owners(
            lines=np.array(lines, dtype=np.int64).reshape(-1, len(Line._fields)),
            contacts=contacts,
            chosen=np.array(chosen, dtype=np.int64),
            places=np.array([numbers.address for numbers in self._numbers], dtype=np.int64),
            parameters=np.zeros(start),
            frames=frames_of(robot.model, [i for owner in owners for i in owner.frame_ids]),
            corners=np.zeros((CORNERS * (1 + contacts), 2)),
        )
        self._work = np.zeros(max([WORK, *(owner.room for owner in owners)]))
        self._count, self._wrench_dim = count, wrench_dim
        bounds = np.zeros(count), np.zeros(count)
        wrenches = np.zeros(wrench_dim), np.zeros(wrench_dim)
        self.write_into(np.zeros((count, robot.nv)), 0, *bounds, np.ones(count), *wrenches)
        self._compile(robot)

    def write_into(
        self,
        matrix: Float64[np.ndarray, "rows columns"],
        first: int,
        target: Float64[np.ndarray, " m"],
        upper: Float64[np.ndarray, " m"],
        weight: Float64[np.ndarray, " m"],
        wrench_lower: Float64[np.ndarray, " w"],
        wrench_upper: Float64[np.ndarray, " w"],
    ) -> None:
        """Set the memory that everything is written into, see `Rows`."""
        drift, reference, error, fade, rate, feedforward = np.zeros((6, self._count))
        self.rows = Rows(
            matrix=matrix,
            target=target,
            upper=upper,
            weight=weight,
            drift=drift,
            reference=reference,
            error=error,
            fade=fade,
            error_rate=rate,
            feedforward=feedforward,
            wrench_lower=wrench_lower,
            wrench_upper=wrench_upper,
            first=first,
        )
        self.assembly = StackNumbers(
            owners=self.inputs,
            rows=self.rows,
            work=self._work,
            count=len(self.owners),
            velocities=0,
        )
        # Coefficients are written where a joint moves them; elsewhere they stay zero.
        for owner, place in zip(self.owners, self._places, strict=True):
            J = matrix[first + place.start : first + place.stop, : self._nv]
            J[:] = 0.0
            owner.write_constants(J)
            owner.evaluation = None

    def update(self, dynamics: Dynamics, *, velocities: bool = False, settling_at: int = 0) -> None:
        """Evaluate all for one state, and the `Settling` at an address, 0 for none.

        Tasks without a target hold what the robot does now.
        """
        self.update_own(dynamics)
        state_at = dynamics.numbers.address
        if not evaluate(self.assembly.address, settling_at, state_at, velocities):
            for owner in self.owners:
                owner.hold(dynamics)
            evaluate(self.assembly.address, settling_at, state_at, velocities)
        for task, place in self.own:
            task.reference = self.rows.reference[place]
        for owner, _ in self._compiled:
            if owner.evaluation is not self:
                break
        else:
            return
        for owner, place in self._compiled:
            owner.view(self.rows, place, self._nv)
            owner.evaluation = self

    def update_own(self, dynamics: Dynamics) -> None:
        """Evaluate the tasks in Python for one state, without their references."""
        for task, place in self.own:
            task.write_own(dynamics, self.rows, place)

    def _compile(self, robot: Robot) -> None:
        """Evaluate nothing once, so that nothing is compiled in a tick."""
        say_if_slow(evaluate, "tasks and contacts")
        self.assembly.count = 0
        evaluate(self.assembly.address, 0, any_dynamics(robot).numbers.address, False)
        self.assembly.count = len(self.owners)


@compiled
def evaluate(assembly_at: int, settling_at: int, state_at: int, velocities: bool) -> bool:
    """Write the rows of all owners for one state, and bounds of joints where there are any.

    Returns False where a target is missing.
    """
    assembly, state = view(StackNumbers, assembly_at), view(StateNumbers, state_at)
    assembly.velocities = 1 if velocities else 0
    if settling_at != 0:
        limit = view(Settling, settling_at)
        joints = len(limit.lower)
        q, v = state.q[len(state.q) - joints :], state.v[len(state.v) - joints :]
        bound_joints(limit.viability, q, v, limit.lower, limit.upper)
    if not _evaluate_owners(state, assembly):
        return False
    if settling_at != 0 and assembly.count > 0:
        bound_settling(state, assembly, view(Settling, settling_at))
    return True


@part
def _evaluate_owners(state: StateNumbers, assembly: StackNumbers) -> bool:
    owners = assembly.owners
    _gather(owners)
    for i in range(assembly.count):
        line = line_of(owners, i)
        if line.kind == CONTACT:
            contact_rows(state, assembly, line)
        elif line.kind == BALANCE:
            bound_balance(state, assembly, line)
        elif line.kind == SELF_COLLISION:
            bound_self_collision(state, assembly, line)
        elif not _evaluate_task(state, assembly, line):
            return False
    return True


@part
def _evaluate_task(state: StateNumbers, assembly: StackNumbers, line: Line) -> bool:
    parameters, target = assembly.owners.parameters, line.start + GAINS * line.dim
    if line.kind == OWN:
        own_rows(state, assembly, line)
    elif np.isnan(parameters[target]) or (
        line.turns and np.isnan(parameters[target + TARGET_ROTATION])
    ):
        return False
    elif line.kind == COM:
        com_rows(state, assembly, line)
    elif line.kind == MOMENTUM:
        momentum_rows(state, assembly, line)
    elif line.kind == JOINTS:
        joint_rows(state, assembly, line)
    elif line.kind == FRAME:
        frame_rows(state, assembly, line)
    else:
        relative_frame_rows(state, assembly, line)
    feed_back(assembly, line)
    return True


@part
def _gather(owners: Owners) -> None:
    """Copy the parameters of all owners."""
    at = 0
    for place in owners.places:
        numbers = view(Numbers, place).all
        for k in range(len(numbers)):
            owners.parameters[at + k] = numbers[k]
        at += len(numbers)
