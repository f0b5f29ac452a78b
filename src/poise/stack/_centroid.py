"""`MomentumTask`: centroidal angular momentum.

`ComTask`: the centre of mass.
"""

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers
from poise._compiled import part
from poise.dynamics import Dynamics, StateNumbers, momentum_rate
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack._axes import COM_SPEED, parse_axes
from poise.stack._tables import GAINS, Line, StackNumbers
from poise.stack._targets import VectorTarget
from poise.stack._task import ShippedTask, write_measured


class ComTask(ShippedTask[VectorTarget]):
    """The centre of mass follows a target in the world: J_com dv + drift = reference.

    Args:
        axes: which world axes count: "position", "xy", "z", ...
        kp: stiffness [1/s^2].
        kd: damping [1/s]; critical when None.
        weight: weight of its rows in their level.
        speed: largest speed that feedback asks for [m/s]; 0.35 when None.
        name: what reports call it.
    """

    def __init__(
        self,
        axes: str = "position",
        *,
        kp: Numbers = 40.0,
        kd: Numbers | None = None,
        weight: Numbers = 1.0,
        speed: Numbers | None = None,
        name: str = "com",
    ) -> None:
        super().__init__(name, kp=kp, kd=kd, weight=weight, speed=speed)
        self.chosen = parse_axes(axes, {"position": 0})
        self._masked = np.setdiff1d(np.arange(3), self.chosen)
        self._target = VectorTarget(3, f"task {name!r}")

    def set_target(
        self,
        position: Numbers,
        velocity: Numbers | None = None,
        acceleration: Numbers | None = None,
    ) -> None:
        """Set where the CoM should be.

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
        """Target of the CoM [m]; None until one is set or taken from the robot."""
        return self._target.position

    def masked_target(self) -> Float64[np.ndarray, "3"]:
        """The target along the axes that count, NaN along the others [m]."""
        shown = self._target.position
        if shown is None:
            return np.full(3, np.nan)
        if len(self._masked):
            shown[self._masked] = np.nan
        return shown

    def hold(self, dynamics: Dynamics) -> None:
        """Take a target that was never set from the robot.

        Args:
            dynamics: the state, up to date.
        """
        self._target.hold(dynamics.com)

    def _resolve(self, robot: Robot) -> int:  # noqa: ARG002
        return len(self.chosen)

    def _usual_speed(self, robot: Robot) -> Numbers:  # noqa: ARG002
        return COM_SPEED


class MomentumTask(ShippedTask[VectorTarget]):
    """The angular momentum about the CoM follows a target: A_G dv + A_Gdot v = Ldot_ref.

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
        self.chosen = parse_axes(axes, {"angular": 0})
        self._target = VectorTarget(3, f"task {name!r}")
        self._target.set(np.zeros(3))

    def set_gains(self, kp: Numbers | None = None, kd: Numbers | None = None) -> None:
        """Set the gain of the momentum error, from the next tick.

        Args:
            kp: zero or None: there is no position to hold.
            kd: gain of the momentum error [1/s].

        Raises:
            ConfigurationError: a stiffness, no `kd`, one of the wrong length, or one that is
                negative or not finite.
        """
        stiffness, _ = self._checked_gains(0.0 if kp is None else kp, kd)
        if kd is None or stiffness.any():
            raise ConfigurationError(
                f"task {self.name!r} has one gain, that of the momentum itself",
                got={"kp": kp, "kd": kd},
                wanted="kd alone",
            )
        super().set_gains(kp, kd)

    def set_target(self, momentum: Numbers, rate: Numbers | None = None) -> None:
        """Set the reference angular momentum about the CoM.

        Args:
            momentum: along the world's axes [kg m^2/s].
            rate: its rate [N m], zero when None.

        Raises:
            TargetError: wrong shape, NaN or infinite.
        """
        self._target.set(momentum, rate)

    def _resolve(self, robot: Robot) -> int:  # noqa: ARG002
        return len(self.chosen)


@part
def com_rows(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """The CoM; its Jacobian and drift are the linear momentum's over the mass."""
    motion, owners, work = state.motion, assembly.owners, assembly.work
    parameters, mass = owners.parameters, motion.mass[0]
    momentum_rate(motion, work, 0)
    for i in range(line.dim):
        axis = int(owners.chosen[line.chosen + i])
        actual = _write_momentum_row(state, assembly, axis, mass, line.first + i)
        target = line.start + GAINS * line.dim + axis
        error, velocity = parameters[target] - motion.com[axis], parameters[target + 3]
        ahead, drift = parameters[target + 6], work[axis] / mass
        write_measured(assembly, line, i, error, 1.0, velocity, actual, ahead, drift)


@part
def momentum_rows(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """The angular momentum about the CoM; its target's first rate is the feedforward."""
    owners, work = assembly.owners, assembly.work
    momentum_rate(state.motion, work, 0)
    for i in range(line.dim):
        axis = int(owners.chosen[line.chosen + i])
        actual = _write_momentum_row(state, assembly, 3 + axis, 1.0, line.first + i)
        target = line.start + GAINS * line.dim + axis
        momentum, ahead = owners.parameters[target], owners.parameters[target + 3]
        drift = work[3 + axis]
        write_measured(assembly, line, i, momentum - actual, 1.0, momentum, actual, ahead, drift)


@part
def _write_momentum_row(
    state: StateNumbers, assembly: StackNumbers, component: int, divisor: float, row: int
) -> float:
    """A row of the centroidal momentum map A_G over a divisor; returns its product with v."""
    v, motion, rows = state.v, state.motion, assembly.rows
    actual = 0.0
    for k in range(len(v)):
        x = motion.momentum[k, component] / divisor
        rows.matrix[rows.first + row, k] = x
        actual += x * v[k]
    return actual
