"""`Evaluation`: the shipped tasks and contacts of a set, evaluated by one compiled call."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import say_if_slow
from poise._copies import Copied
from poise.dynamics import Dynamics, frames_of
from poise.robots import Robot, once_a_robot
from poise.stack._kernels import evaluate
from poise.stack._tables import CORNERS, ENTRIES, WORK, Assembly, Kind, Numbers, Owners, Rows


class Owner(Copied):
    """A task or contact whose formulas are compiled.

    Attributes:
        kind: which formulas.
        dim: number of rows.
        parameters: all that they read, see `_kernels`; the array stays the same.
        frame_ids: frames that they need.
        chosen: components that have rows, or coordinates of `v`.
        turns: whether there is a target rotation.
        sine: whether the orientation error is the sine.
        room: numbers of work space that the formulas need.
        evaluation: who evaluated it last.
        jacobian: J of its rows; as the two below, a view that the next evaluation overwrites.
        drift: their acceleration at zero `dv`.
        reference: their reference acceleration.
    """

    foreign = (
        *("evaluation", "_alone", "jacobian", "drift", "reference"),
        *("error", "error_rate", "_fade"),
    )
    kind: Kind
    dim: int
    parameters: Float64[np.ndarray, " p"]
    frame_ids: tuple[int, ...] = ()
    chosen: Int64[np.ndarray, " c"] = np.zeros(0, dtype=np.int64)
    turns = False
    sine = False
    room = WORK
    evaluation: "Evaluation | None" = None
    jacobian: Float64[np.ndarray, "m nv"]
    drift: Float64[np.ndarray, " m"]
    reference: Float64[np.ndarray, " m"]
    _alone: "Evaluation | None" = None

    def evaluate_alone(self, dynamics: Dynamics) -> Rows:
        """Evaluates it apart from all others."""
        if self._alone is None:
            wrench_dim = self.dim if self.kind is Kind.CONTACT else 0
            whole = slice(0, self.dim)
            self._alone = Evaluation(dynamics.robot, [self], [whole], self.dim, wrench_dim)
        self._alone.update(dynamics)
        return self._alone.rows

    def hold(self, dynamics: Dynamics) -> None:
        """Takes what was never set of its target from the robot."""

    def reset(self) -> None:
        """Forgets what was taken from the robot."""

    def view(self, rows: Rows, own: slice, nv: int) -> None:
        """Takes views of its rows as its attributes."""
        self.jacobian = rows.matrix[rows.first + own.start : rows.first + own.stop, :nv]
        self.drift, self.reference = rows.drift[own], rows.reference[own]

    def write_constants(self, J: Float64[np.ndarray, "m nv"]) -> None:
        """Writes coefficients that never change."""


@once_a_robot
def any_dynamics(robot: Robot) -> Dynamics:
    """Dynamics of any state of a robot, for calls that compile."""
    return Dynamics(robot)


class Evaluation:
    """Evaluates some tasks and contacts together.

    Attributes:
        rows: what was written.
        owners: tasks and contacts.
        inputs: what compiled code knows of them.
        assembly: all of it for compiled code.
    """

    def __init__(
        self,
        robot: Robot,
        owners: Sequence[Owner],
        places: Sequence[slice],
        count: int,
        wrench_dim: int,
    ) -> None:
        self.owners, self._places, self._nv = tuple(owners), tuple(places), robot.nv
        self._numbers = [Numbers(all=owner.parameters) for owner in owners]
        table = np.zeros((len(owners), ENTRIES), dtype=np.int64)
        start = frames = chosen = 0
        for line, owner, place in zip(table, owners, places, strict=True):
            root = frames + len(owner.frame_ids) - 1
            turns, sine = int(owner.turns), int(owner.sine)
            first = [int(owner.kind), place.start, owner.dim, start, frames, root, chosen]
            line[:] = [*first, turns, sine]
            start += len(owner.parameters)
            frames += len(owner.frame_ids)
            chosen += len(owner.chosen)
        self.inputs = Owners(
            lines=table,
            chosen=np.concatenate([np.zeros(0, dtype=np.int64), *(o.chosen for o in owners)]),
            places=np.array([numbers.address for numbers in self._numbers], dtype=np.int64),
            parameters=np.zeros(start),
            frames=frames_of(robot.model, [i for owner in owners for i in owner.frame_ids]),
            corners=np.zeros((CORNERS * (1 + sum(o.kind is Kind.CONTACT for o in owners)), 2)),
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
        """Has everything written there from now on, see `Rows`."""
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
        self.assembly = Assembly(
            owners=self.inputs, rows=self.rows, work=self._work, count=len(self.owners)
        )
        # Rows are written where a joint moves them; elsewhere they stay zero.
        for owner, place in zip(self.owners, self._places, strict=True):
            J = matrix[first + place.start : first + place.stop, : self._nv]
            J[:] = 0.0
            owner.write_constants(J)
            owner.evaluation = None

    def update(self, dynamics: Dynamics, *, velocities: bool = False) -> None:
        """Evaluates all for one state; tasks without a target hold what the robot does now."""
        if not self.owners:
            return
        if not evaluate(self.assembly.address, dynamics.numbers.address, velocities):
            self.hold(dynamics)
            evaluate(self.assembly.address, dynamics.numbers.address, velocities)
        self.hand_out()

    def hold(self, dynamics: Dynamics) -> None:
        """Has tasks without a target hold what the robot does in a state."""
        for owner in self.owners:
            owner.hold(dynamics)

    def hand_out(self) -> None:
        """Gives owners that were evaluated elsewhere last views of their rows here."""
        for owner in self.owners:
            if owner.evaluation is not self:
                break
        else:
            return
        for owner, place in zip(self.owners, self._places, strict=True):
            owner.view(self.rows, place, self._nv)
            owner.evaluation = self

    def _compile(self, robot: Robot) -> None:
        """Evaluates nothing once, so that nothing is compiled in a tick."""
        say_if_slow(evaluate, "tasks and contacts")
        self.assembly.count = 0
        evaluate(self.assembly.address, any_dynamics(robot).numbers.address, False)
        self.assembly.count = len(self.owners)
