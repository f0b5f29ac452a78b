"""`InvariantFilter`: base pose and velocity from an inertial unit and points at rest.

The right-invariant extended Kalman filter of Hartley, Ghaffari, Eustice and Grizzle (2020),
"Contact-aided invariant extended Kalman filtering for robot state estimation", with the biases of
the inertial unit and contact points that come and go. The dynamics of its error do not depend on
the state, so a bad first guess does not spoil the covariance, and absolute position and yaw, which
cannot be observed, keep theirs.
"""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._compiled import allocate, say_if_slow
from poise.estimation._config import ImuNoise, InitialDeviation
from poise.estimation._group import right_error
from poise.estimation._memory import CONTACTS, POSITION, VELOCITY, FilterMemory
from poise.estimation._tick import (
    CHECK,
    CORRECT,
    HOLD,
    INNOVATE,
    INNOVATE_BIAS,
    PROPAGATE,
    RELEASE,
    run,
)


class InvariantFilter:
    """Filter of measurements by an inertial unit and the kinematics.

    Its arrays are its memory and change with it. Nothing here raises on numbers: any that is not
    finite makes `sound` false.

    Args:
        contacts: largest number of contact points.
        noise: of the inertial unit.

    Attributes:
        rotation: world_R_imu.
        velocity: of the unit, in the world [m/s].
        position: of the unit, in the world [m].
        points: contact points, in the world; valid where `held` [m].
        held: 1 for contact points in the state.
        gyro_bias: along the unit's axes [rad/s].
        accelerometer_bias: along the unit's axes [m/s^2].
        covariance: of the right-invariant error, in blocks of three: orientation, velocity,
            position, contact points (zero where none is held), gyro bias, accelerometer bias. All
            but the biases are along the world's axes and about its origin.
        memory: all of these, for compiled code.
    """

    def __init__(self, contacts: int, noise: ImuNoise | None = None) -> None:
        noise = noise if noise is not None else ImuNoise()
        sizes = {"contacts": contacts, "m": 2 + contacts, "n": 15 + 3 * contacts}
        m = self.memory = allocate(FilterMemory, sizes | {"2": 2, "3": 3, "4": 4})
        m.density[:] = noise.gyro, noise.accelerometer, noise.gyro_bias, noise.accelerometer_bias
        self.rotation, self.velocity, self.position = m.R, m.x[VELOCITY], m.x[POSITION]
        self.points, self.held = m.x[CONTACTS:], m.active
        self.gyro_bias, self.accelerometer_bias = m.bias
        self.covariance = m.P
        self.start(np.eye(3), np.zeros(3))
        # Compiled now, not in the first tick.
        say_if_slow(run, "the state estimator")
        self._run(CHECK)

    def start(
        self,
        rotation: Float64[np.ndarray, "3 3"],
        position: Float64[np.ndarray, "3"],
        *,
        gyro_bias: Float64[np.ndarray, "3"] | None = None,
        deviation: InitialDeviation | None = None,
    ) -> None:
        """Start at rest, with no contact point.

        Args:
            rotation: world_R_imu.
            position: of the unit [m].
            gyro_bias: of the gyro, zero if not given [rad/s].
            deviation: of all that.
        """
        d = deviation if deviation is not None else InitialDeviation()
        m = self.memory
        m.R[:], m.x[:], m.bias[:], m.active[:], m.P[:] = rotation, 0.0, 0.0, 0, 0.0
        m.x[POSITION] = position
        m.bias[0] = 0.0 if gyro_bias is None else gyro_bias
        self._widen(np.array([d.tilt, d.tilt, d.yaw]), d.velocity)
        variances = np.einsum("ii->i", m.P)
        variances[6:9] += d.position**2
        variances[-6:] = np.repeat([d.gyro_bias, d.accelerometer_bias], 3) ** 2

    def _widen(self, turn: Float64[np.ndarray, "3"], velocity: float) -> None:
        """Add deviations of orientation, about the unit, and velocity to the covariance."""
        # P is about the world's origin.
        lever = np.vstack([np.eye(3), pin.skew(self.velocity), pin.skew(self.position)])
        self.memory.P[:9, :9] += lever @ np.diag(turn**2) @ lever.T
        self.memory.P[3:6, 3:6] += velocity**2 * np.eye(3)

    def propagate(
        self,
        angular_velocity: Float64[np.ndarray, "3"],
        specific_force: Float64[np.ndarray, "3"],
        dt: float,
        walk: Float64[np.ndarray, " contacts"] | float = 0.0,
    ) -> None:
        """Advance by the readings of a period.

        Args:
            angular_velocity: mean, along the unit's axes [rad/s].
            specific_force: mean acceleration less gravity, along the unit's axes [m/s^2].
            dt: duration of the period [s].
            walk: density of the walk of contact points [m/s/sqrt(Hz)].
        """
        m = self.memory
        m.imu[0], m.imu[1], m.contact_density[:] = angular_velocity, specific_force, walk
        self._run(PROPAGATE, dt=dt)

    def hold(
        self,
        contact: int,
        offset: Float64[np.ndarray, "3"],
        spread: Float64[np.ndarray, "3 3"],
    ) -> None:
        """Add a contact point to the state, or replace one.

        Args:
            contact: its number.
            offset: its position from the unit by the kinematics, along the unit's axes [m].
            spread: covariance of that [m^2].
        """
        m = self.memory
        m.offset[:], m.spread[:] = offset, spread
        if m.active[contact]:
            self._run(RELEASE, contact=contact)
        self._run(HOLD, contact=contact)

    def release(self, contact: int) -> None:
        """Remove a contact point from the state.

        Args:
            contact: its number.
        """
        self._run(RELEASE, contact=contact)

    def innovate(
        self,
        contact: int,
        offset: Float64[np.ndarray, "3"],
        spread: Float64[np.ndarray, "3 3"],
    ) -> float:
        """Innovate by a held contact point.

        Args:
            contact: its number.
            offset: its position from the unit by the kinematics, along the unit's axes [m].
            spread: covariance of that [m^2].

        Returns:
            The square of the Mahalanobis distance, chi-squared with three degrees of freedom where
            the point is at rest; NaN where the covariance is singular.
        """
        m = self.memory
        m.offset[:], m.spread[:] = offset, spread
        return self._run(INNOVATE, contact=contact)

    def innovate_bias(
        self, bias: Float64[np.ndarray, "3"], spread: Float64[np.ndarray, "3 3"]
    ) -> float:
        """Innovate by a measurement of the gyro's bias.

        A foot at rest does not turn, so the kinematics measure the turn of the unit, and the
        gyro's reading less that is its bias. Only this shows the bias about the vertical.

        Args:
            bias: as measured, along the unit's axes [rad/s].
            spread: covariance of that [rad^2/s^2].

        Returns:
            The square of the Mahalanobis distance, as `innovate`.
        """
        m = self.memory
        m.offset[:], m.spread[:] = bias, spread
        return self._run(INNOVATE_BIAS)

    def correct(self) -> None:
        """Correct the state by the last innovation."""
        self._run(CORRECT)

    def loosen(self, *, tilt: float = 0.0, velocity: float = 0.0) -> None:
        """Inflate the covariance of tilt and velocity, about the unit.

        Args:
            tilt: further deviation of the orientation about horizontal axes [rad].
            velocity: further deviation of the velocity [m/s].
        """
        self._widen(np.array([tilt, tilt, 0.0]), velocity)

    def _run(self, operation: int, *, contact: int = 0, dt: float = 0.0) -> float:
        return run(self.memory.address, operation, contact, 0.0, dt)

    @property
    def sound(self) -> bool:
        """True where all numbers are finite and no variance is negative."""
        return self._run(CHECK) != 0.0

    def error(
        self,
        rotation: Float64[np.ndarray, "3 3"],
        velocity: Float64[np.ndarray, "3"],
        position: Float64[np.ndarray, "3"],
    ) -> Float64[np.ndarray, "9"]:
        """Return the right-invariant error against the truth, whose covariance is `covariance`.

        Args:
            rotation: world_R_imu.
            velocity: of the unit, in the world [m/s].
            position: of the unit, in the world [m].

        Returns:
            Orientation [rad], velocity [m/s], position [m].
        """
        truth = np.array([velocity, position])
        return right_error((self.rotation, self.memory.x[:CONTACTS]), (rotation, truth))
