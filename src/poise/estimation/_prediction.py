"""`StatePredictor`: the state of now, where sensors are late by a known time.

`StampedPredictor`: the same where clock and stamps say how late they are.
"""

import math
from collections import deque

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import all_finite
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.robots import Robot


class StatePredictor:
    """Prediction over the delay between a measurement and the torque that answers it.

    A state that is d old is carried on by the n = d / T accelerations a_i that the robot has been
    commanded since, the first of them the oldest:

        v(t) = v(t - d) + T sum a_i
        q(t) = q(t - d) (+) (d v(t - d) + T^2 sum (n - i - 1/2) a_i),    i = 0 ... n - 1

    It is exact while the robot does what it is told, and what a model or a push adds within d is
    missing. Wrenches stay as old as they are. It goes behind the estimator:

        estimator=lambda state: predictor.predict(estimator.update(state))

    and `command` is called with what the controller answered, after each tick.

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
        self._model, self._period = robot.model, period
        self._still = np.zeros(robot.nv)
        self._commanded = deque([self._still] * count, maxlen=count)
        left = (count - np.arange(count) - 0.5) * period * period
        self._left: Float64[np.ndarray, " n"] = left

    def reset(self) -> None:
        """Restart with a robot that stands still."""
        self._commanded.extend([self._still] * len(self._commanded))

    def command(self, acceleration: Float64[np.ndarray, " nv"] | None) -> None:
        """Note the last command.

        Args:
            acceleration: that the command was computed for, as `Command.acceleration`
                [m/s^2, rad/s^2]; what is missing or not finite counts as none.
        """
        if acceleration is None or not all_finite(acceleration):
            acceleration = self._still
        self._commanded.append(acceleration.copy())

    def predict(self, state: RobotState) -> RobotState:
        """Return the state at which the next command begins to act.

        Args:
            state: as measured or estimated, `delay` old; one of another robot comes back as it is.
        """
        if not self._commanded or state.q.shape != (self._model.nq,):
            return state
        return _carried_on(self._model, state, np.array(self._commanded), self._left, self._period)


_OLDEST = 25
"""Commands that are remembered: a state that is older is carried on by no more of them."""

_JUMP = 1.0
"""A state that is so much older than the last command is of a clock that has gone back [s]."""

_LONGEST = 0.05
"""A command that comes later than this after the one before follows a pause [s]."""


class StampedPredictor:
    """Prediction over the age of a state, by its stamp and the clock of commands.

    The sum of `StatePredictor`, over all commands that the robot has been given since the state was
    measured: of a state that is not late there are none, and it stays as it is. Nobody has to know
    the delay, and it may change.

    Where soles rock and masses are other than believed, a robot does only a part of what it is
    commanded: then a part of the accelerations is nearer to the truth than all of them.
    """

    def __init__(self, robot: Robot, share: float = 1.0) -> None:
        if not 0.0 <= share <= 1.0:
            raise ConfigurationError(
                "share of the commanded accelerations", got=share, wanted="0 <= share <= 1"
            )
        self._model, self._share = robot.model, share
        self._still = np.zeros(robot.nv)
        self.reset()

    def reset(self) -> None:
        """Forget all commands."""
        self._commanded: deque[tuple[float, Float64[np.ndarray, " nv"]]] = deque(maxlen=_OLDEST)

    def command(self, acceleration: Float64[np.ndarray, " nv"] | None, time: float) -> None:
        """Note the last command."""
        if not math.isfinite(time):
            return
        if self._commanded and not 0.0 < time - self._commanded[-1][0] < _LONGEST:
            self.reset()
        if acceleration is None or not all_finite(acceleration):
            acceleration = self._still
        self._commanded.append((time, acceleration.copy()))

    def predict(self, state: RobotState) -> RobotState:
        """Return the state at which the next command begins to act."""
        if len(self._commanded) < 2 or state.q.shape != (self._model.nq,):
            return state
        (oldest, _), (newest, _) = self._commanded[0], self._commanded[-1]
        period = (newest - oldest) / (len(self._commanded) - 1)
        measured = state.time - 0.5 * period
        # Of a state that is not late, or has no time, not even the newest command came since.
        if not newest > measured or newest - state.time > _JUMP:
            return state
        since = [a for time, a in self._commanded if time > measured]
        left = (len(since) - np.arange(len(since)) - 0.5) * period * period
        return _carried_on(self._model, state, self._share * np.array(since), left, period)


def _carried_on(
    model: pin.Model,
    state: RobotState,
    commanded: Float64[np.ndarray, "n nv"],
    left: Float64[np.ndarray, " n"],
    period: float,
) -> RobotState:
    """Return the state after n commands of one period each."""
    delay = len(commanded) * period
    return RobotState(
        pin.integrate(model, state.q, delay * state.v + left @ commanded),
        state.v + period * commanded.sum(axis=0),
        state.contacts,
        state.time + delay,
        state.readings,
        state.payload,
    )
