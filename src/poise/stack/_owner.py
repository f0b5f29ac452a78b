"""`Owner`: a task, contact or limit whose formulas are compiled."""

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64, Int64

from poise._copies import Copied
from poise.dynamics import Dynamics
from poise.stack._tables import WORK, Kind, Rows

if TYPE_CHECKING:
    from poise.stack._evaluation import Evaluation


class Owner(Copied):
    """A task or contact whose formulas are compiled.

    Attributes:
        kind: which formulas.
        dim: number of rows.
        parameters: all that they read, the array stays the same.
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
        """Evaluate it apart from all others."""
        if self._alone is None:
            # An evaluation knows the formulas of all owners.
            from poise.stack._evaluation import Evaluation

            wrench_dim = self.dim if self.kind is Kind.CONTACT else 0
            whole = slice(0, self.dim)
            self._alone = Evaluation(dynamics.robot, [self], [whole], self.dim, wrench_dim)
        self._alone.update(dynamics)
        return self._alone.rows

    def hold(self, dynamics: Dynamics) -> None:
        """Take what was never set of its target from the robot."""

    def reset(self) -> None:
        """Forget what was taken from the robot."""

    def view(self, rows: Rows, own: slice, nv: int) -> None:
        """Take views of its rows as its attributes."""
        self.jacobian = rows.matrix[rows.first + own.start : rows.first + own.stop, :nv]
        self.drift, self.reference = rows.drift[own], rows.reference[own]

    def write_constants(self, J: Float64[np.ndarray, "m nv"]) -> None:
        """Write coefficients that never change."""
