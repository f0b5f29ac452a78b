"""`ComTask`: the centre of mass."""

import numpy as np
from jaxtyping import Float64

from poise.checks import Numbers
from poise.dynamics.dynamics import Dynamics
from poise.dynamics.rates import MatrixRates
from poise.robots.robot import Robot
from poise.tasks.axes import as_rows, parse_axes
from poise.tasks.task import Task
from poise.tasks.vector_target import VectorTarget


class ComTask(Task):
    """The centre of mass follows a target in the world: J_com dv + drift = reference.

    Args:
        axes: which world axes count: "position", "xy", "z", ...
        kp: stiffness [1/s^2].
        kd: damping [1/s]; critical when None.
        weight: weight of its rows in their level.
        name: what reports call it.
    """

    def __init__(
        self,
        axes: str = "position",
        *,
        kp: Numbers = 40.0,
        kd: Numbers | None = None,
        weight: Numbers = 1.0,
        name: str = "com",
    ) -> None:
        super().__init__(name, kp=kp, kd=kd, weight=weight)
        index = parse_axes(axes, {"position": 0})
        self._size, self._rows = len(index), as_rows(index)
        self._target = VectorTarget(3, f"task {name!r}")

    def set_target(
        self,
        position: Numbers,
        velocity: Numbers | None = None,
        acceleration: Numbers | None = None,
    ) -> None:
        """Sets where the COM should be.

        Args:
            position: in the world [m].
            velocity: [m/s], zero when None.
            acceleration: [m/s^2], zero when None.

        Raises:
            TargetError: wrong shape, NaN or infinite.
        """
        self._target.set(position, velocity, acceleration)

    @property
    def target_position(self) -> Float64[np.ndarray, "3"] | None:
        """Where the COM should be [m]; None until a target is set or taken from the robot."""
        return self._target.position

    def masked_target(self) -> Float64[np.ndarray, "3"]:
        """The target along the axes that count, NaN along the others [m]."""
        shown = np.full(3, np.nan)
        if self._target.position is not None:
            shown[self._rows] = self._target.position[self._rows]
        return shown

    def reset(self) -> None:
        """Forgets a target that was taken from the robot."""
        self._target.release_hold()

    def jacobian_rate(self, rates: MatrixRates) -> Float64[np.ndarray, "m nv"]:
        """Exact time derivative of `jacobian`: the momentum's linear rows over the mass."""
        return (rates.momentum_matrix[:3] / self.robot.mass)[self._rows]

    def _resolve(self, robot: Robot) -> int:  # noqa: ARG002
        return self._size

    def _evaluate(self, dynamics: Dynamics) -> Float64[np.ndarray, " m"]:
        rows, target = self._rows, self._target
        self.jacobian = dynamics.com_jacobian[rows]
        self.drift = dynamics.com_bias[rows]
        self.error = target.error(dynamics.com)[rows]
        self.error_rate = (target.velocity - dynamics.com_velocity)[rows]
        return target.acceleration[rows]
