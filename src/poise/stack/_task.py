"""`Task`: an objective of the robot, as rows of an acceleration-level equation."""

import math
from abc import ABC, abstractmethod
from copy import copy
from typing import Generic, TypeGuard, TypeVar, cast

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers
from poise._compiled import part
from poise._show import brief
from poise.dynamics import Dynamics, StateNumbers
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack._axes import checked_gain, checked_speed, checked_target
from poise.stack._bound_once import BoundOnce
from poise.stack._owner import Owner
from poise.stack._tables import (
    ACCELERATION,
    GAINS,
    GIVEN_VELOCITY,
    KD,
    KP,
    RATE,
    SPEED,
    WEIGHT,
    Line,
    Rows,
    StackNumbers,
)
from poise.stack._targets import PoseTarget, VectorTarget

_HUGE = 1e306
"""Speeds are cut to this: the norm of a hundred does not overflow."""

_GIVEN = {ACCELERATION: "acceleration", GIVEN_VELOCITY: "velocity"}
"""Replacements of the feedback, by their row among the gains."""

T = TypeVar("T", VectorTarget, PoseTarget)


class Task(Owner, BoundOnce, ABC):
    """A quantity of the robot that should follow a reference: `J dv + drift = reference`.

    Feedback around a user's target asks for a velocity, bounded in norm in each block of rows, and
    for the acceleration that leads to it,

        velocity = sat(max(speed, |target_velocity|), target_velocity + kp / kd error)
        reference = target_acceleration + kd (velocity - J v)

    with sat(x, u) = x u / max(x, |u|), (17) and (18) of Zhang and Kikuuwe, "COM Shifter and Body
    Rotator for Step-by-Step Teleoperation of Bipedal Robots". The direction is kept, and a target
    is approached with `speed` however far it is, while one that moves faster is followed as fast as
    it moves. Below these speeds it is plain PD feedback,

        reference = target_acceleration + kp error + kd error_rate.

    Rows without stiffness or without damping are that always. What `set_acceleration` or
    `set_velocity` was given replaces all this. A task depends on no solver and no controller:
    `evaluate` computes the attributes below for one state, once a tick.

    Args:
        name: what reports and messages call it.
        kp: stiffness, one number or one an axis [1/s^2].
        kd: damping [1/s]; critical, 2 sqrt(kp), when None.
        weight: weight of its rows against other rows of the same level.
        speed: largest norm of the velocity that feedback asks for, one number or one for each of
            `blocks` [unit/s]; none, inf, when None.

    Attributes:
        name: what reports and messages call it.
        unit: unit of `error`.
        dim: number of rows; known once bound to a robot.
        jacobian: J.
        drift: acceleration of the task at zero `dv`.
        error: target minus actual [unit].
        error_rate: its rate [unit/s].
        reference: reference acceleration [unit/s^2].
    """

    # The part of the error that is fed back; a frame's turn is near half a turn.
    _fade: Float64[np.ndarray, " m"] | float = 1.0

    def __init__(
        self,
        name: str,
        *,
        kp: Numbers,
        kd: Numbers | None,
        weight: Numbers,
        speed: Numbers | None = None,
    ) -> None:
        self.name = name
        self.unit = "m"
        self.dim = 0
        self._whats = {row: f"{what} of task {name!r}" for row, what in _GIVEN.items()}
        # Shape is checked when the number of rows is known; sign and finiteness at once.
        self._checked_gains(kp, kd)
        self._checked_weight(weight)
        self._gains = (copy(kp), copy(kd), copy(weight))
        self._speed: Numbers | None = None
        if speed is not None:
            self.set_speed(speed)
        # What was set last, where that was plain numbers for bound rows.
        self._plain_weight: tuple[float, ...] | None = None
        # What was given before the number of rows was known.
        self._given: dict[int, Float64[np.ndarray, " m"]] = {}

    def _bind(self, robot: Robot) -> None:
        self.dim = m = self._resolve(robot)
        kp, kd, weight = self._gains
        rows = np.full((GAINS, m), np.nan)
        _write_gains(rows, *self._checked_gains(kp, kd))
        rows[WEIGHT] = self._checked_weight(weight)
        for row, value in self._given.items():
            rows[row] = checked_target(value, m, self._whats[row])
        speed = self._usual_speed(robot) if self._speed is None else self._speed
        rows[SPEED] = np.repeat(self._checked_speed(speed, len(self.blocks)), self.blocks)
        self.parameters = np.concatenate((rows.ravel(), self._target_numbers()))
        self.jacobian: Float64[np.ndarray, "m nv"] = np.zeros((m, robot.nv))
        self.drift, self.error, self.error_rate, self.reference = np.zeros((4, m))

    def share_memory(self) -> None:
        """Turn the arrays into views of the memory that the compiled formulas read."""
        if self._robot is not None:
            self._gain_rows = self.parameters[: GAINS * self.dim].reshape(GAINS, self.dim)
            self._gains_to_read = self._gain_rows.view()
            self._gains_to_read.flags.writeable = False

    def _target_numbers(self) -> Float64[np.ndarray, " k"]:
        """Numbers of the target that compiled formulas read."""
        return np.zeros(0)

    @property
    def _title(self) -> str:
        return f"task {self.name!r}"

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {self.describe()})"

    def describe(self) -> str:
        """Gains, weight and a speed that was set, in a few words."""
        kp, kd, weight = self._gains if self._robot is None else (self.kp, self.kd, self.weight)
        if kd is None:
            kd = 2.0 * np.sqrt(np.asarray(kp, dtype=np.float64))
        said = f"kp={brief(kp)}, kd={brief(kd)}"
        return said if brief(weight) == "1" else f"{said}, weight={brief(weight)}"

    @property
    def kp(self) -> Float64[np.ndarray, " m"]:
        """Stiffness of each row [1/s^2], known once bound to a robot; `set_gains` changes it."""
        return self._gain(KP)

    @property
    def kd(self) -> Float64[np.ndarray, " m"]:
        """Damping of each row [1/s], known once bound to a robot; `set_gains` changes it."""
        return self._gain(KD)

    @property
    def weight(self) -> Float64[np.ndarray, " m"]:
        """Weight of each row, known once bound to a robot; `set_weight` changes it."""
        return self._gain(WEIGHT)

    @property
    def velocity_gain(self) -> Float64[np.ndarray, " m"]:
        """Gain of the error in the task's velocity, kp / kd [1/s]; zero without stiffness.

        A PD controller with these gains lets a slow error die out at this rate.
        """
        return self._gain(RATE)

    @property
    def speed(self) -> Float64[np.ndarray, " b"]:
        """Largest speed that feedback asks of each of `blocks` [unit/s]; `set_speed` changes it."""
        _ = self.robot
        ends = np.cumsum(self.blocks, dtype=np.int64)
        return self._gain_rows[SPEED, ends - 1]

    def set_speed(self, speed: Numbers) -> None:
        """Bound the velocity that feedback asks for, from the next tick.

        Args:
            speed: largest norm, one number or one for each of `blocks` [unit/s]; inf for none.

        Raises:
            ConfigurationError: wrong length, NaN, or numbers that are not positive.
        """
        if self._robot is None:
            self._checked_speed(speed, np.size(speed))
            self._speed = copy(speed)
        else:
            speeds = self._checked_speed(speed, len(self.blocks))
            self._gain_rows[SPEED] = np.repeat(speeds, self.blocks)

    def _gain(self, row: int) -> Float64[np.ndarray, " m"]:
        if self._robot is None:
            _ = self.robot  # the number of rows is unknown, and this says so
        return self._gains_to_read[row]

    def set_gains(self, kp: Numbers | None = None, kd: Numbers | None = None) -> None:
        """Set stiffness and damping, from the next tick.

        Args:
            kp: stiffness, one number or one a row [1/s^2]; as it is when None.
            kd: damping [1/s]; critical, 2 sqrt(kp), when None.

        Raises:
            ConfigurationError: wrong length, or gains that are not finite or negative.
        """
        if kp is None:
            kp = self._gains[0] if self._robot is None else self.kp
        stiffness, damping = self._checked_gains(kp, kd)
        if self._robot is None:
            self._gains = (copy(kp), copy(kd), self._gains[2])
        else:
            _write_gains(self._gain_rows, stiffness, damping)

    def set_acceleration(self, acceleration: Numbers | None) -> None:
        """Replace the PD reference by a given acceleration; None restores the PD.

        Args:
            acceleration: reference acceleration, one a row [unit/s^2].

        Raises:
            TargetError: wrong shape, NaN or infinite.
        """
        self._give(ACCELERATION, acceleration)

    def overwrite_acceleration(self) -> Float64[np.ndarray, " m"]:
        """Return the row that `set_acceleration` sets, for a leader: nothing is checked."""
        return self._gain_rows[ACCELERATION]

    def set_velocity(self, velocity: Numbers | None) -> None:
        """Replace the reference velocity by a given one; None restores the target's.

        Only controllers that command velocities follow it: `DifferentialIK`. Those that command
        torques go by accelerations, see `set_acceleration`.

        Args:
            velocity: reference velocity J v, one a row [unit/s; kg m^2/s for momentum].

        Raises:
            TargetError: wrong shape, NaN or infinite.
        """
        self._give(GIVEN_VELOCITY, velocity)

    def _give(self, row: int, value: Numbers | None) -> None:
        """Put a number a row, or NaN for none, in place of what feedback would ask for."""
        if value is not None:
            size = self.dim if self._robot is not None else np.size(value)
            value = checked_target(value, size, self._whats[row])
        if self._robot is not None:
            self._gain_rows[row] = np.nan if value is None else value
        elif value is None:
            self._given.pop(row, None)
        else:
            self._given[row] = value.copy()

    def set_weight(self, weight: Numbers) -> None:
        """Set the weight of its rows against other rows of the same level, from the next tick.

        Args:
            weight: one number or one a row.

        Raises:
            ConfigurationError: wrong length, or weights that are not finite and positive.
        """
        # Plain numbers each tick, as leaders have them: no array to check.
        row = (weight,) * self.dim if isinstance(weight, float) else weight
        if self._robot is not None and isinstance(row, tuple):
            try:
                known = row == self._plain_weight
            except ValueError:
                known = False  # Its arrays are listed below.
            if known:
                return
            if len(row) == self.dim and _are_weights(row):
                self._gain_rows[WEIGHT] = self._plain_weight = row
                return
        found = self._checked_weight(weight)
        self._plain_weight = None
        if self._robot is None:
            self._gains = (*self._gains[:2], copy(weight))
        else:
            self._gain_rows[WEIGHT] = found

    def _checked_gains(
        self, kp: Numbers, kd: Numbers | None
    ) -> tuple[Float64[np.ndarray, " kp"], Float64[np.ndarray, " kd"]]:
        """Stiffness and damping, critical where none is given; one a row once rows are known."""
        stiffness = self._checked_gain(kp, "kp", " [1/s^2]")
        if kd is None:
            return stiffness, 2.0 * np.sqrt(stiffness)
        return stiffness, self._checked_gain(kd, "kd", " [1/s]")

    def _checked_weight(self, weight: Numbers) -> Float64[np.ndarray, " m"]:
        return self._checked_gain(weight, "weight", positive=True)

    def _checked_gain(
        self, value: Numbers, what: str, unit: str = "", *, positive: bool = False
    ) -> Float64[np.ndarray, " m"]:
        what = f"{what} of task {self.name!r}{unit}"
        return checked_gain(value, self.dim or np.size(value), what, positive=positive)

    def _checked_speed(self, value: Numbers, blocks: int) -> Float64[np.ndarray, " b"]:
        return checked_speed(value, blocks, f"largest speed of task {self.name!r}")

    @property
    def given_velocity(self) -> Float64[np.ndarray, " m"] | None:
        """Argument of `set_velocity`; None for nothing."""
        given = self._gain_rows[GIVEN_VELOCITY]
        return None if np.isnan(given[0]) else given

    @property
    def is_compiled(self) -> bool:
        """False, for a task in Python."""
        return False

    def view(self, rows: Rows, own: slice, nv: int) -> None:
        """Take views of its rows as its attributes."""
        super().view(rows, own, nv)
        self.error, self.error_rate = rows.error[own], rows.error_rate[own]
        self._fade = rows.fade[own]

    def _usual_speed(self, robot: Robot) -> Numbers:  # noqa: ARG002
        """Return the default of `speed`; the unit of a custom task has none."""
        return math.inf

    @abstractmethod
    def _resolve(self, robot: Robot) -> int:
        """Look names up on the robot and return the number of rows."""

    @abstractmethod
    def _evaluate(self, dynamics: Dynamics) -> Float64[np.ndarray, " m"]:
        """Fill in everything but `reference`; return the target's acceleration, masked."""

    def write_own(self, dynamics: Dynamics, rows: Rows, own: slice) -> None:
        """Write what `_evaluate` finds, from which compiled feedback makes the reference."""
        try:
            rows.feedforward[own] = feedforward = self._evaluate(dynamics)
            m, nv = self.dim, dynamics.robot.nv
            found = {
                "jacobian": (self.jacobian, (m, nv)),
                "drift": (self.drift, (m,)),
                "error": (self.error, (m,)),
                "error_rate": (self.error_rate, (m,)),
                "target's acceleration": (feedforward, (m,)),
            }
            for what, (numbers, shape) in found.items():
                # One that fits by being repeated would not be noticed.
                if np.shape(numbers) != shape:
                    raise TaskFaultError(
                        f"{what} of task {self.name!r} has a wrong shape",
                        got=np.shape(numbers),
                        wanted=f"{shape}",
                    )
            rows.matrix[rows.first + own.start : rows.first + own.stop, :nv] = self.jacobian
            rows.drift[own], rows.fade[own] = self.drift, self._fade
            rows.error[own], rows.error_rate[own] = self.error, self.error_rate
        except TaskFaultError:
            raise
        except Exception as error:
            raise TaskFaultError(
                f"task {self.name!r} cannot be evaluated",
                got=f"{type(error).__name__}: {error}",
                wanted="`_evaluate` to fill `jacobian` (m, nv), `drift`, `error` and `error_rate` "
                "(m) and to return the target's acceleration (m)",
            ) from error


class TaskFaultError(ConfigurationError):
    """A task of a user's own that cannot be evaluated, or leaves arrays of a wrong shape."""


class ShippedTask(Task, Generic[T]):
    """A task whose formulas are compiled.

    One that has an `_evaluate` of its own is evaluated in Python, like any task of a user; what it
    calls by `super()` is compiled.
    """

    _target: T

    @property
    def is_compiled(self) -> bool:
        """True where no method of a subclass replaces the compiled formulas."""
        return type(self)._evaluate is ShippedTask._evaluate

    def share_memory(self) -> None:
        """Turn the arrays into views of the memory that the compiled formulas read."""
        super().share_memory()
        if self._robot is not None:
            self._target.memory = self.parameters[GAINS * self.dim :]

    def _target_numbers(self) -> Float64[np.ndarray, " k"]:
        return self._target.memory

    def overwrite_target(self) -> Float64[np.ndarray, "rows size"]:
        """Return the target's numbers, for a leader to write what it computed: nothing is checked.

        Returns:
            Position, velocity and acceleration, a row each; of a pose its position, three rows of
            its rotation, then linear and angular velocity and acceleration.
        """
        return self._target.overwrite()

    def reset(self) -> None:
        """Forget a target that was taken from the robot."""
        self._target.release_hold()

    def _evaluate(self, dynamics: Dynamics) -> Float64[np.ndarray, " m"]:
        return self._evaluate_alone(dynamics, compiled=True).feedforward


def _are_weights(row: tuple[object, ...]) -> TypeGuard[tuple[float, ...]]:
    """Return True where all are plain numbers, finite and positive."""
    if {*map(type, row)} != {float}:
        return False
    numbers = cast("tuple[float, ...]", row)
    # The sum of a NaN and others is not finite either.
    return min(numbers) > 0.0 and math.isfinite(sum(numbers))


def _write_gains(
    rows: Float64[np.ndarray, "gains m"],
    kp: Float64[np.ndarray, " m"],
    kd: Float64[np.ndarray, " m"],
) -> None:
    """Write stiffness, damping, and kp / kd, which is zero without stiffness."""
    rows[KP], rows[KD], rows[RATE] = kp, kd, 0.0
    with np.errstate(divide="ignore"):
        np.divide(kp, kd, out=rows[RATE], where=kp > 0.0)


@part
def write_measured(
    assembly: StackNumbers,
    line: Line,
    i: int,
    error: float,
    fade: float,
    velocity: float,
    actual: float,
    feedforward: float,
    drift: float,
) -> None:
    """Write what a task's row measures; `target` holds the target's velocity until `feed_back`."""
    rows, row = assembly.rows, line.first + i
    rows.error[row], rows.fade[row], rows.error_rate[row] = error, fade, velocity - actual
    rows.drift[row], rows.feedforward[row] = drift, feedforward
    rows.target[row] = velocity


@part
def own_rows(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """Rows of a task in Python, which stand there already but for the target's velocity."""
    v, rows = state.v, assembly.rows
    for row in range(line.first, line.first + line.dim):
        # The rate of an error is the target's velocity less that of the robot, J v.
        rows.target[row] = rows.error_rate[row]
        for k in range(len(v)):
            rows.target[row] += rows.matrix[rows.first + row, k] * v[k]


@part
def feed_back(assembly: StackNumbers, line: Line) -> None:
    """Feedback of a task's rows as in `Task`, or what was given in its place; by blocks."""
    owners, begin, block = assembly.owners, 0, line.chosen + line.size
    while begin < line.dim:
        end = int(owners.chosen[block])
        _feed_back_block(assembly, line, begin, end)
        begin, block = end, block + 1


@part
def _fed_back(assembly: StackNumbers, line: Line, i: int) -> tuple[float, float]:
    """Velocity that a row with stiffness and damping asks for, and its target's; zero of others."""
    rows, parameters, row = assembly.rows, assembly.owners.parameters, line.first + i
    gains = line.start + i
    rate = parameters[gains + RATE * line.dim]
    if not (parameters[gains + KD * line.dim] > 0.0 and rate > 0.0):
        return 0.0, 0.0
    velocity = min(max(rows.target[row], -_HUGE), _HUGE)
    asked = velocity + rate * rows.fade[row] * rows.error[row]
    return min(max(asked, -_HUGE), _HUGE), velocity


@part
def _feed_back_block(assembly: StackNumbers, line: Line, begin: int, end: int) -> None:
    rows, velocities, parameters = assembly.rows, assembly.velocities, assembly.owners.parameters
    m, gains, first = line.dim, line.start, line.first
    asked_square = target_square = 0.0
    for i in range(begin, end):
        asked, velocity = _fed_back(assembly, line, i)
        asked_square += asked * asked
        target_square += velocity * velocity
    most, target = math.sqrt(asked_square), math.sqrt(target_square)
    if np.isinf(asked_square):
        most = target = 0.0
        for i in range(begin, end):
            asked, velocity = _fed_back(assembly, line, i)
            most, target = math.hypot(most, asked), math.hypot(target, velocity)
    part = 1.0
    if most > target:
        part = min(max(parameters[gains + SPEED * m + begin], target) / most, 1.0)
    for i in range(begin, end):
        row = first + i
        kp, kd = parameters[gains + KP * m + i], parameters[gains + KD * m + i]
        rate = parameters[gains + RATE * m + i]
        error, velocity = rows.fade[row] * rows.error[row], rows.target[row]
        asked = velocity + rate * error
        reference = kp * error + kd * rows.error_rate[row] + rows.feedforward[row]
        if part < 1.0 and kd > 0.0 and rate > 0.0:
            actual = velocity - rows.error_rate[row]
            asked = part * min(max(asked, -_HUGE), _HUGE)
            reference = kd * (asked - actual) + rows.feedforward[row]
        given = parameters[gains + ACCELERATION * m + i]
        if not np.isnan(given):
            reference = given
        given = parameters[gains + GIVEN_VELOCITY * m + i]
        if not np.isnan(given):
            asked = given
        rows.reference[row], rows.weight[row] = reference, parameters[gains + WEIGHT * m + i]
        rows.target[row] = rows.upper[row] = asked if velocities else reference - rows.drift[row]
