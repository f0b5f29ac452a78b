"""`Owner`: a task, a contact or rows of a limit, which one compiled call evaluates."""

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64, Int64

from poise._copies import Copied
from poise.dynamics import Dynamics
from poise.stack._tables import WORK, Rows

if TYPE_CHECKING:
    from poise.stack._evaluation import Evaluation


class Owner(Copied):
    """Base of owners of rows: tasks, contacts and limits.

    Attributes:
        dim: number of rows.
        parameters: all that the formulas read; the array stays the same.
        frame_ids: frames that they need.
        chosen: components that have rows, or coordinates of `v`.
        blocks: sizes of the blocks of rows that share a unit and turn into one another as axes do.
        turns: True where there is a target rotation.
        sine: True where the orientation error is the sine.
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
    _alone: "dict[bool, Evaluation] | None" = None

    @property
    def is_compiled(self) -> bool:
        """True where all of its formulas are compiled."""
        return True

    @property
    def blocks(self) -> tuple[int, ...]:
        """Sizes of the blocks of rows that share a unit and turn into one another as axes turn."""
        return (self.dim,)

    def evaluate(self, dynamics: Dynamics) -> None:
        """Evaluate at one state: `jacobian`, `drift`, `reference`, errors of tasks.

        A target that was never set becomes what the robot does at the first evaluation: hold.

        Args:
            dynamics: the state, up to date.
        """
        self._evaluate_alone(dynamics, self.is_compiled)

    def _evaluate_alone(self, dynamics: Dynamics, compiled: bool) -> Rows:
        """Evaluate it apart from all others, by its compiled formulas or those of a user."""
        if self._alone is None:
            self._alone = {}
        if compiled not in self._alone:
            # An evaluation has the formulas of all owners.
            from poise.stack._evaluation import Evaluation

            made = Evaluation(
                dynamics.robot, [self], [slice(0, self.dim)], self.dim, self.dim, compiled
            )
            self._alone[compiled] = made
        self._alone[compiled].update(dynamics)
        return self._alone[compiled].rows

    def hold(self, dynamics: Dynamics) -> None:
        """Set the parts of the target that were never set from the robot's state.

        Args:
            dynamics: the state, up to date.
        """

    def reset(self) -> None:
        """Forget targets that were taken from the robot itself, not those a user set."""

    def view(self, rows: Rows, own: slice, nv: int) -> None:
        """Take views of its rows as its attributes."""
        self.jacobian = rows.matrix[rows.first + own.start : rows.first + own.stop, :nv]
        self.drift, self.reference = rows.drift[own], rows.reference[own]

    def write_constants(self, J: Float64[np.ndarray, "m nv"]) -> None:
        """Write coefficients that never change."""
