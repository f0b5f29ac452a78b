"""`Task`: something the robot should do, as rows of an acceleration-level equation."""

import math
from abc import ABC, abstractmethod
from copy import copy
from itertools import accumulate, pairwise
from typing import TypeGuard, cast

import numpy as np
from jaxtyping import Bool, Float64

from poise._checks import Numbers
from poise._compiled import part
from poise._copies import Copied
from poise._show import brief
from poise.dynamics import Dynamics, saturate
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack._axes import checked_gain, checked_speed, checked_target
from poise.stack._tables import (
    ACCELERATION,
    COUNT,
    FIRST,
    GAINS,
    GIVEN_VELOCITY,
    KD,
    KP,
    RATE,
    SPEED,
    START,
    WEIGHT,
    Line,
    StackNumbers,
)

_PLAIN = {float}

_HUGE = 1e150
"""Speeds are cut to this, whose square does not overflow."""

_GIVEN = {ACCELERATION: "acceleration", GIVEN_VELOCITY: "velocity"}
"""What a user may give in place of feedback, by its row among the gains."""


class Task(Copied, ABC):
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
    `set_velocity` was given stands in place of all this. A task knows no solver and no controller:
    `evaluate` leaves everything it has to say about one state in the attributes below, once a tick.

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
        self._robot: Robot | None = None
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
        # The part of the error that is fed back; a frame's turn is near half a turn.
        self._fade: Float64[np.ndarray, " m"] | float = 1.0
        # What was given before the number of rows was known.
        self._given: dict[int, Float64[np.ndarray, " m"]] = {}

    def bind(self, robot: Robot) -> None:
        """Resolve names on a robot and allocates; controllers call it before the first tick.

        Args:
            robot: the robot whose frames and joints the task names.

        Raises:
            UnknownNameError: a frame or joint that the robot does not have.
            ConfigurationError: a gain of the wrong length, or the task serves another robot.
            TargetError: a target, acceleration or velocity given before that has the wrong length.
        """
        if self._robot is robot:
            return
        if self._robot is not None:
            raise ConfigurationError(
                f"task {self.name!r} already serves another robot",
                got=robot.name,
                wanted=f"robot {self._robot.name!r}, or a task of its own",
            )
        self.dim = self._resolve(robot)
        kp, kd, weight = self._gains
        rows = np.full((GAINS, self.dim), np.nan)
        _write_gains(rows, *self._checked_gains(kp, kd))
        rows[WEIGHT] = self._checked_weight(weight)
        for row, value in self._given.items():
            rows[row] = checked_target(value, self.dim, self._whats[row])
        speed = self._usual_speed(robot) if self._speed is None else self._speed
        speeds = self._checked_speed(speed, len(self.blocks))
        self._take_gains(rows)
        self._take_speeds(speeds)
        self.jacobian: Float64[np.ndarray, "m nv"] = np.zeros((self.dim, robot.nv))
        self.drift: Float64[np.ndarray, " m"] = np.zeros(self.dim)
        self.error: Float64[np.ndarray, " m"] = np.zeros(self.dim)
        self.error_rate: Float64[np.ndarray, " m"] = np.zeros(self.dim)
        self.reference: Float64[np.ndarray, " m"] = np.zeros(self.dim)
        self._robot = robot

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {self.describe()})"

    def describe(self) -> str:
        """Gains, weight and a speed that was set, in a few words."""
        kp, kd, weight = self._gains if self._robot is None else (self.kp, self.kd, self.weight)
        if kd is None:
            kd = 2.0 * np.sqrt(np.asarray(kp, dtype=np.float64))
        said = f"kp={brief(kp)}, kd={brief(kd)}"
        return said if brief(weight) == "1" else f"{said}, weight={brief(weight)}"

    def _take_gains(self, rows: Float64[np.ndarray, "gains m"]) -> None:
        """Set the array whose rows are the gains."""
        self._gain_rows = rows
        self._gains_to_read = rows.view()
        self._gains_to_read.flags.writeable = False

    def share_memory(self) -> None:
        """Make views of its gains."""
        if self._robot is not None:
            self._take_gains(self._gain_rows)

    def is_bound_to(self, robot: Robot) -> bool:
        """Return True where it is bound to that robot.

        Args:
            robot: the robot.
        """
        return self._robot is robot

    @property
    def robot(self) -> Robot:
        """The robot the task serves.

        Raises:
            ConfigurationError: it serves none yet.
        """
        if self._robot is None:
            raise ConfigurationError(
                f"task {self.name!r} serves no robot yet",
                wanted="a controller made with it, or a call of bind(robot)",
            )
        return self._robot

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
        return self._speeds.copy()

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
            self._take_speeds(self._checked_speed(speed, len(self.blocks)))

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
        """Replace the PD reference by a given acceleration; None brings the PD back.

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
        """Replace the reference velocity by a given one; None brings the target's back.

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
                known = False  # It holds arrays, which are told below.
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

    def _take_speeds(self, speeds: Float64[np.ndarray, " b"]) -> None:
        ends = [*accumulate(self.blocks, initial=0)]
        self._speeds, self._block_rows = speeds, [np.arange(a, b) for a, b in pairwise(ends)]
        self._gain_rows[SPEED] = np.repeat(speeds, self.blocks)

    @property
    def given_velocity(self) -> Float64[np.ndarray, " m"] | None:
        """Argument of `set_velocity`; None for nothing."""
        given = self._gain_rows[GIVEN_VELOCITY]
        return None if np.isnan(given[0]) else given

    def evaluate(self, dynamics: Dynamics) -> None:
        """Fill in `jacobian`, `drift`, `error`, `error_rate` and `reference` for one state.

        A target that was never set becomes what the robot does at the first evaluation: hold.

        Args:
            dynamics: the state, up to date.
        """
        feedforward = self._evaluate(dynamics)
        given = self._gain_rows[ACCELERATION]
        if not np.isnan(given[0]):
            self.reference = given
            return
        kp, kd = self._gain_rows[KP], self._gain_rows[KD]
        self.reference = kp * (self._fade * self.error) + kd * self.error_rate + feedforward
        if np.isfinite(self._speeds).any():
            asked, cut = self._bound(dynamics)
            missing = asked - self.jacobian @ dynamics.v
            self.reference[cut] = (kd * missing + feedforward)[cut]

    def asked_velocity(self, dynamics: Dynamics) -> Float64[np.ndarray, " m"]:
        """Velocity J v that feedback asks for, after `evaluate` [unit/s].

        Args:
            dynamics: the state that was evaluated.
        """
        return self._bound(dynamics)[0]

    def _bound(
        self, dynamics: Dynamics
    ) -> tuple[Float64[np.ndarray, " m"], Bool[np.ndarray, " m"]]:
        """Velocity that feedback asks for, and the rows in which `speed` bounds it."""
        # The rate of an error is the target's velocity less that of the robot, J v.
        target = self.error_rate + self.jacobian @ dynamics.v
        fed_back = (self._gain_rows[KP] > 0.0) & (self._gain_rows[KD] > 0.0)
        asked, cut = target.copy(), np.zeros(self.dim, dtype=np.bool_)
        error = self._fade * self.error
        asked[fed_back] += self._gain_rows[RATE, fed_back] * error[fed_back]
        for rows, speed in zip(self._block_rows, self._speeds.tolist(), strict=True):
            block = rows[fed_back[rows]]
            bound = max(speed, math.hypot(*target[block].tolist()))
            if math.hypot(*asked[block].tolist()) > bound:
                asked[block], cut[block] = saturate(bound, asked[block]), True
        return asked, cut

    def reset(self) -> None:
        """Forget targets that the task took from the robot itself, not those a user set."""

    @property
    def blocks(self) -> tuple[int, ...]:
        """Sizes of the blocks of rows that share a unit and turn into one another as axes turn."""
        return (self.dim,)

    def _usual_speed(self, robot: Robot) -> Numbers:  # noqa: ARG002
        """Return the default of `speed`; the unit of a custom task has none."""
        return math.inf

    @abstractmethod
    def _resolve(self, robot: Robot) -> int:
        """Look names up on the robot and returns the number of rows."""

    @abstractmethod
    def _evaluate(self, dynamics: Dynamics) -> Float64[np.ndarray, " m"]:
        """Fill in everything but `reference`; returns the target's acceleration, masked."""


class TaskFaultError(ConfigurationError):
    """A task of a user's own that cannot be evaluated, or leaves arrays of a wrong shape."""


def evaluate_own(task: Task, dynamics: Dynamics) -> None:
    """Evaluate a task that may be a user's own."""
    try:
        task.evaluate(dynamics)
        m, nv = task.dim, dynamics.robot.nv
        for what, shape in (
            ("jacobian", (m, nv)),
            ("drift", (m,)),
            ("error", (m,)),
            ("error_rate", (m,)),
            ("reference", (m,)),
        ):
            # One that fits by being repeated would not be noticed.
            found = np.shape(getattr(task, what))
            if found != shape:
                raise TaskFaultError(
                    f"{what} of task {task.name!r} has a wrong shape", got=found, wanted=f"{shape}"
                )
    except TaskFaultError:
        raise
    except Exception as error:
        raise TaskFaultError(
            f"task {task.name!r} cannot be evaluated",
            got=f"{type(error).__name__}: {error}",
            wanted="`_evaluate` to fill `jacobian` (m, nv), `drift`, `error` and `error_rate` (m) "
            "and to return the target's acceleration (m)",
        ) from error


def _are_weights(row: tuple[object, ...]) -> TypeGuard[tuple[float, ...]]:
    """Return True where all are plain numbers, finite and positive."""
    if {*map(type, row)} != _PLAIN:
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
    """Write what a task's row measures; `target` holds the target's velocity until `ask`."""
    rows, parameters = assembly.rows, assembly.owners.parameters
    row = line[FIRST] + i
    rows.error[row], rows.fade[row], rows.error_rate[row] = error, fade, velocity - actual
    rows.drift[row], rows.feedforward[row] = drift, feedforward
    rows.target[row] = velocity
    rows.weight[row] = parameters[line[START] + WEIGHT * line[COUNT] + i]


@part
def ask(assembly: StackNumbers, line: Line, begin: int, end: int) -> None:
    """Feedback of a block of a task's rows as in `Task`, or what was given in its place."""
    rows, velocities, parameters = assembly.rows, assembly.velocities, assembly.owners.parameters
    m, gains, first = line[COUNT], line[START], line[FIRST]
    asked_square = target_square = 0.0
    for i in range(begin, end):
        kd, rate = parameters[gains + KD * m + i], parameters[gains + RATE * m + i]
        if kd > 0.0 and rate > 0.0:
            velocity = min(max(rows.target[first + i], -_HUGE), _HUGE)
            asked = velocity + rate * rows.fade[first + i] * rows.error[first + i]
            asked = min(max(asked, -_HUGE), _HUGE)
            asked_square += asked * asked
            target_square += velocity * velocity
    part = 1.0
    if asked_square > target_square:
        speed = max(parameters[gains + SPEED * m + begin], math.sqrt(target_square))
        part = min(speed / math.sqrt(asked_square), 1.0)
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
        rows.reference[row] = reference
        rows.target[row] = rows.upper[row] = asked if velocities else reference - rows.drift[row]
