"""`MomentumTask`: centroidal angular momentum."""

import numpy as np
from jaxtyping import Float64

from poise.checks import Numbers
from poise.dynamics.dynamics import Dynamics
from poise.dynamics.rates import MatrixRates
from poise.robots.robot import Robot
from poise.tasks.axes import as_rows, parse_axes
from poise.tasks.task import Task
from poise.tasks.vector_target import VectorTarget


class MomentumTask(Task):
    """The angular momentum about the COM follows a target: A_G dv + A_Gdot v = Ldot_ref.

    Momentum has no position to hold, so feedback is on the momentum alone:
    Ldot_ref = target rate + kd (target - actual). Momentum is a velocity, and its error stands in
    `error_rate`; it stands in `error` too, which is what reports show.

    Args:
        axes: "angular", "angular_xy", "z", ... about the world's axes.
        kd: gain of the momentum error [1/s].
        weight: weight of its rows in their level.
        name: what reports call it.
    """

    def __init__(
        self,
        axes: str = "angular",
        *,
        kd: Numbers = 5.0,
        weight: Numbers = 1.0,
        name: str = "angular momentum",
    ) -> None:
        super().__init__(name, kp=0.0, kd=kd, weight=weight)
        self.unit = "kg m^2/s"
        index = parse_axes(axes, {"angular": 0})
        self._size, self._rows = len(index), as_rows(index)
        self._target = VectorTarget(3, f"task {name!r}")
        self._target.set(np.zeros(3))

    def set_target(self, momentum: Numbers, rate: Numbers | None = None) -> None:
        """Sets the wanted angular momentum about the COM.

        Args:
            momentum: along the world's axes [kg m^2/s].
            rate: its rate [N m], zero when None.

        Raises:
            TargetError: wrong shape, NaN or infinite.
        """
        self._target.set(momentum, rate)

    def jacobian_rate(self, rates: MatrixRates) -> Float64[np.ndarray, "m nv"]:
        """Exact time derivative of `jacobian`."""
        return rates.momentum_matrix[3:][self._rows]

    def _resolve(self, robot: Robot) -> int:  # noqa: ARG002
        return self._size

    def _evaluate(self, dynamics: Dynamics) -> Float64[np.ndarray, " m"]:
        rows = self._rows
        self.jacobian = dynamics.momentum_matrix[3:][rows]
        self.drift = dynamics.momentum_bias[3:][rows]
        self.error = self.error_rate = self._target.error(dynamics.momentum[3:])[rows]
        return self._target.velocity[rows]
