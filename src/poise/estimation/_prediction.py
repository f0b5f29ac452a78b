"""States predicted over the delay of the sensors, known in advance or by stamps."""

import math
from collections import deque
from dataclasses import replace

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import all_finite
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.estimation._config import LONGEST_STEP
from poise.robots import Robot


class StatePredictor:
    """Prediction over the delay between a measurement and the torque that answers it.

    A state of age d is integrated over the n = d / T accelerations a_i commanded since, the oldest
    first:

        v(t) = v(t - d) + T sum a_i
        q(t) = q(t - d) (+) (d v(t - d) + T^2 sum (n - i - 1/2) a_i),    i = 0 ... n - 1

    It is exact while the robot follows its commands; pushes and errors of the model within d are
    missing. Wrenches stay as old as they are. It follows the estimator,

        estimator=lambda state: predictor.predict(estimator.update(state))

    and takes each command after its tick.

    Args:
        robot: the robot.
        delay: d, age of the state when its torque begins to act [s].
        period: T, from one command to the next [s].

    Raises:
        ConfigurationError: the delay is negative, or no whole number of periods.
    """

    def __init__(self, robot: Robot, delay: float, period: float) -> None:
        known = 0.0 < period < math.inf and 0.0 <= delay < math.inf
        count = round(delay / period) if known else -1
        if count < 0 or abs(count * period - delay) > 1e-6:
            raise ConfigurationError(
                "a delay that is predicted over is no whole number of periods",
                got=(delay, period),
                wanted="delay >= 0 s, a multiple of the period",
            )
        self._model, self._period, self._still = robot.model, period, np.zeros(robot.nv)
        self._commanded = deque([self._still] * count, maxlen=count)

    def reset(self) -> None:
        """Restart with a robot that stands still."""
        self._commanded.extend([self._still] * len(self._commanded))

    def command(self, acceleration: Float64[np.ndarray, " nv"] | None) -> None:
        """Take the last command.

        Args:
            acceleration: of the command, as `Command.acceleration` [m/s^2, rad/s^2]; zero where it
                is None or not finite.
        """
        self._commanded.append(_usable(acceleration, self._still))

    def predict(self, state: RobotState) -> RobotState:
        """Return the state at which the next command begins to act.

        Args:
            state: as measured or estimated, `delay` old; one of another robot is returned as it is.
        """
        if not self._commanded or state.q.shape != (self._model.nq,):
            return state
        return _integrated(self._model, state, np.array(self._commanded), self._period)


_JUMP = 1.0
"""Age of a state at the last command that means a clock stepped back [s]."""


class StampedPredictor:
    """Prediction over the age of a state, by its stamp and the clock of commands.

    The sum of `StatePredictor`, over all commands since the stamp of the state, so that the delay
    may be unknown and change. A state that is not late stays as it is.

    Args:
        robot: the robot.
        share: part of the commanded accelerations that the robot follows, from 0 to 1; less than 1
            where soles rock and masses differ from the description.

    Raises:
        ConfigurationError: the share is out of range.
    """

    def __init__(self, robot: Robot, share: float = 1.0) -> None:
        if not 0.0 <= share <= 1.0:
            raise ConfigurationError(
                "share of the commanded accelerations", got=share, wanted="0 <= share <= 1"
            )
        self._model, self._share, self._still = robot.model, share, np.zeros(robot.nv)
        self.reset()

    def reset(self) -> None:
        """Discard all commands."""
        self._commanded: deque[tuple[float, Float64[np.ndarray, " nv"]]] = deque(maxlen=25)

    def command(self, acceleration: Float64[np.ndarray, " nv"] | None, time: float) -> None:
        """Take the last command, as `StatePredictor.command`, and its time [s]."""
        if not math.isfinite(time):
            return
        if self._commanded and not 0.0 < time - self._commanded[-1][0] < LONGEST_STEP:
            self.reset()
        self._commanded.append((time, _usable(acceleration, self._still)))

    def predict(self, state: RobotState) -> RobotState:
        """Return the state at which the next command begins to act."""
        if len(self._commanded) < 2 or state.q.shape != (self._model.nq,):
            return state
        (oldest, _), (newest, _) = self._commanded[0], self._commanded[-1]
        period = (newest - oldest) / (len(self._commanded) - 1)
        measured = state.time - 0.5 * period
        # No command came since a state that is not late, or has no time.
        if not newest > measured or newest - state.time > _JUMP:
            return state
        since = np.array([a for time, a in self._commanded if time > measured])
        return _integrated(self._model, state, self._share * since, period)


def _usable(
    acceleration: Float64[np.ndarray, " nv"] | None, still: Float64[np.ndarray, " nv"]
) -> Float64[np.ndarray, " nv"]:
    """Return a copy of a commanded acceleration, or zeros where it is missing or not finite."""
    return (still if acceleration is None or not all_finite(acceleration) else acceleration).copy()


def _integrated(
    model: pin.Model, state: RobotState, commanded: Float64[np.ndarray, "n nv"], period: float
) -> RobotState:
    """Return the state after n commands of one period each."""
    count = len(commanded)
    left = (count - np.arange(count) - 0.5) * period
    q = pin.integrate(model, state.q, period * (count * state.v + left @ commanded))
    v = state.v + period * commanded.sum(axis=0)
    return replace(state, q=q, v=v, time=state.time + count * period)
