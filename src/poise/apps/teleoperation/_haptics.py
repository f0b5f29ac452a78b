"""`HapticFeet`: two arms with force feedback as a `Device`, one for each foot."""

import math
import time as clock
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64
from msgspec.structs import replace

from poise._checks import checked_number
from poise.dynamics import saturate
from poise.errors import ConfigurationError
from poise.locomotion import (
    SILENT_AFTER,
    FieldError,
    OperatorSample,
    StepTeleoperator,
    TrackedFeet,
    TrackedPose,
    WarnOnce,
    along_ahead,
    checked_reading,
)

# Where the end of an arm is, forward, left and up from anywhere [m], and whether it leads
Reading = tuple[Float64[np.ndarray, "3"], bool]


@runtime_checkable
class HapticArm(Protocol):
    """A device of three degrees of freedom that one hand holds, such as a Novint Falcon.

    Neither call may wait: both are made once a period of the device, a thousand times a second.
    """

    def read(self) -> Reading | None:
        """Return the hand's position and the state of its clutch; None for a disconnected arm.

        The arm counts as disconnected, too, where a call raises or a reading is not finite.
        """
        ...

    def write(self, force: Float64[np.ndarray, "3"]) -> None:
        """Push the hand until the next call, forward, left and up [N]."""
        ...


class SimulatedArm:
    """Simulated haptic arm, held by a hand like a spring that follows a given motion.

    m x'' = f + k (x_hand - x) - d x' with the force f of the device; each `read` is a period later.

    Args:
        hand: intended position at a time [s], and True while the clutch is closed.
        dt: period [s].
        mass: of arm and hand m [kg].
        stiffness: of a relaxed hand k [N/m].
        damping: of hand and arm d [N s/m].

    Attributes:
        force: of the device on the hand now [N].
        connected: False for an arm that cannot be read.
    """

    def __init__(
        self,
        hand: Callable[[float], Reading],
        *,
        dt: float = 1e-3,
        mass: float = 0.4,
        stiffness: float = 250.0,
        damping: float = 12.0,
    ) -> None:
        self._dt, self._mass, self._stiffness, self._damping = _positive(
            "the arm", dt=dt, mass=mass, stiffness=stiffness, damping=damping
        )
        self._hand, self._periods = hand, 0
        self._position = hand(0.0)[0].copy()
        self._velocity = np.zeros(3)
        self.force: Float64[np.ndarray, "3"] = np.zeros(3)
        self.connected = True

    def read(self) -> Reading | None:
        """Return the place of the hand, a period after the last call."""
        wanted, clutch = self._hand(self._periods * self._dt)
        pull = self._stiffness * (wanted - self._position) - self._damping * self._velocity
        # The velocity first: with the old one the spring would gain energy.
        self._velocity = self._velocity + self._dt / self._mass * (self.force + pull)
        self._position = self._position + self._dt * self._velocity
        self._periods += 1
        return (self._position.copy(), clutch) if self.connected else None

    def write(self, force: Float64[np.ndarray, "3"]) -> None:
        """Push the hand until the next call [N]."""
        self.force = force.copy()


Readings = tuple[Reading | None, Reading | None]


def _positive(owner: str, **numbers: float) -> list[float]:
    return [checked_number(x, f"{name} of {owner}", above=0.0) for name, x in numbers.items()]


class _Hand:
    """A hand at an arm that may fail, and the force of its foot on it, none in stance."""

    def __init__(
        self, arm: HapticArm, side: str, dt: float, gain: float, most: float, smoothing: float,
        washout: float,
    ) -> None:  # fmt: skip
        self._arm, self._side, self._dt, self._gain, self._most = arm, side, dt, gain, most
        self._smoothing, self._washout = smoothing, washout
        self._in_air, self._without = False, 0.0
        self._slow = self._force = np.zeros(3)
        self.error: Exception | None = None
        self._warn_once = WarnOnce()

    def tick(self, foot: Float64[np.ndarray, "3"], total: float, *, heard: bool) -> Reading | None:
        """Read and drive the arm, with forces on the foot and on both [N]; None where it fails."""
        self.error, reading = None, None
        touch = self._touch(foot, total)
        try:
            reading = self._read()
        except Exception as error:
            self._fail(error)
        holds = reading is not None and reading[1] and heard
        goal = saturate(self._most, self._gain * touch) if holds else np.zeros(3)
        left = (goal - self._force) * self._smoothing / (self._smoothing + self._dt)
        # Within a millinewton it is there.
        self._force = goal - left if float(left @ left) > 1e-6 else goal
        try:
            self._arm.write(self._force.copy() if reading is not None else np.zeros(3))
        except Exception as error:
            self._fail(error)
            # It is back as softly as at the beginning.
            self._force = np.zeros(3)
            return None
        return reading

    def _read(self) -> Reading | None:
        reading = checked_reading(f"{self._side} arm", self._arm.read())
        if reading is None or reading.position is None or not np.isfinite(reading.position).all():
            return None
        return np.array(reading.position), bool(reading.clutch)

    def _fail(self, error: Exception) -> None:
        # The first one: what fails after it often does so because of it.
        self.error = self.error or error
        self._warn_once(error, "the %s arm failed, and counts as gone", self._side)

    def _touch(
        self,
        force: Float64[np.ndarray, "3"],
        total: float,
        *,
        least: float = 0.05,
        patience: float = 0.05,
        settled: float = 0.9,
    ) -> Float64[np.ndarray, "3"]:
        """Force on a foot in the air and at its landing, washed out [N]."""
        # As the weight begins to shift to a foot that stands, its load may be gone for a moment.
        unloaded = bool(force[2] < least * total)
        self._without = self._without + self._dt if unloaded else 0.0
        if self._without > patience:
            self._in_air, self._slow = True, np.zeros(3)
        if not self._in_air:
            return np.zeros(3)
        if not unloaded:
            self._slow = self._slow + self._dt / (self._washout + self._dt) * (force - self._slow)
            self._in_air = bool(self._slow[2] < settled * force[2])
        return force - self._slow


class HapticDriver:
    """Read two arms and render on each the contact force of its foot, at the rate of the arms.

    The force on a hand is a fraction of the contact force of its foot, smoothed, high-pass
    filtered after the landing, and at most `force_max`. It goes to zero without data from the
    robot for longer than `silence`, with an open clutch, and where the arm is disconnected or
    fails; the other arm continues.

    Args:
        left: arm of the left foot.
        right: arm of the right foot.
        dt: their period [s].
        gain: force on a hand over force on its foot.
        force_max: largest force on a hand [N].
        smoothing: time constant with which the force follows [s].
        washout: time constant with which a landing fades [s].
        silence: without news from the robot there is no force after this [s].

    Raises:
        ConfigurationError: a number that is not positive.

    Attributes:
        dt: period [s].
        errors: of the left and the right arm in the last period, a `TypeError` for what was no
            place and clutch; None if all was well.
    """

    def __init__(
        self,
        left: HapticArm,
        right: HapticArm,
        *,
        dt: float = 1e-3,
        gain: float = 0.01,
        force_max: float = 6.0,
        smoothing: float = 0.01,
        washout: float = 0.4,
        silence: float = 0.1,
    ) -> None:
        self._silence, self.dt, *numbers = _positive(
            "the arms", silence=silence, dt=dt, gain=gain, force_max=force_max,
            smoothing=smoothing, washout=washout,
        )  # fmt: skip
        self._hands = (
            _Hand(left, "left", self.dt, *numbers),
            _Hand(right, "right", self.dt, *numbers),
        )
        # In one object, which another thread replaces as a whole.
        self._news: tuple[float, Float64[np.ndarray, "2 3"]] = (-math.inf, np.zeros((2, 3)))
        self._known, self._unheard = self._news, 0
        self.errors: tuple[Exception | None, Exception | None] = (None, None)
        # As one object, too, with the time of this machine.
        self._read: tuple[float, Readings] = (-math.inf, (None, None))

    @property
    def readings(self) -> Readings:
        """Last readings, left and right; None for an arm that is disconnected or fails.

        None for both without a `tick` for 0.1 s, or for two periods if those are longer.
        """
        read_at, readings = self._read
        ended = clock.monotonic() - read_at > max(SILENT_AFTER, 2.0 * self.dt)
        return (None, None) if ended else readings

    def feel(self, forces: Sequence[Sequence[float]], now: float) -> None:
        """Set the contact forces of the robot; values that are not finite are ignored.

        Args:
            forces: of the ground on the left and the right foot: forward, left, up [N].
            now: on the clock of `tick` [s].
        """
        array = np.array(forces, dtype=np.float64)
        if array.shape != (2, 3):
            raise ConfigurationError(
                "no forces of two feet", got=array.shape, wanted="two rows: forward, left, up"
            )
        if np.isfinite(array).all():
            self._news = (now, array)

    def tick(self, now: float) -> Readings:
        """Take one period of the arms at a time of any clock [s]; return the `readings`."""
        news = heard_at, feet = self._news
        # Periods are counted, too, because a clock that stops or steps back measures no silence.
        self._unheard = self._unheard + 1 if news is self._known else 0
        self._known = news
        heard = now - heard_at <= self._silence and self._unheard * self.dt <= self._silence
        total = float(feet[:, 2].sum())
        left, right = self._hands
        said = left.tick(feet[0], total, heard=heard), right.tick(feet[1], total, heard=heard)
        self.errors, self._read = (left.error, right.error), (clock.monotonic(), said)
        return said


def foot_forces(teleoperator: StepTeleoperator) -> list[list[float]]:
    """Forces on the left and the right foot in the last tick: forward, left, up [N]."""
    dynamics, forces = teleoperator.estimator.dynamics, list[list[float]]()
    for sole in teleoperator.soles:
        wrench = dynamics.state.wrench(sole)
        turn = dynamics.frame(teleoperator.robot.frame_id(sole)).rotation
        force = [0.0, 0.0, 0.0] if wrench is None else (turn @ wrench[:3]).tolist()
        forces.append(along_ahead(force, -teleoperator.ahead).tolist())
    return forces


class HapticFeet:
    """Two arms as a `Device`: each commands its foot by its motion while its clutch is closed.

    For simulated arms, which are driven up to the robot's time each tick: real ones need a thread
    that calls `HapticDriver.tick` at their rate. A clutch, which has to be open once before, takes
    hold on the foot; forward is the robot's heading then.

    Args:
        driver: of the arms.
        teleoperator: of the feet.
        scale: way of a foot over way of a hand.
    """

    def __init__(
        self, driver: HapticDriver, teleoperator: StepTeleoperator, *, scale: float = 1.0
    ) -> None:
        self.driver, self._teleoperator = driver, teleoperator
        self._feet = TrackedFeet(teleoperator, self._said, scale=scale)
        self._begin, self._periods = 0.0, 0
        self._readings: Readings = (None, None)

    def sample(self, time: float) -> OperatorSample | None:
        """Return goals of the feet at a time of the robot [s]; None while no arm is connected.

        Raises:
            TypeError: an arm returned no place and clutch in its last period.
        """
        driver = self.driver
        driver.feel(foot_forces(self._teleoperator), time)
        # A clock that jumps is followed from where it is then.
        if abs(time - self._begin - self._periods * driver.dt) > SILENT_AFTER:
            self._begin, self._periods = time, 0
        while (now := self._begin + self._periods * driver.dt) <= time:
            # Not `driver.readings`: a slow computer would let go of a simulated robot's feet.
            self._readings = driver.tick(now)
            self._periods += 1
        sample = self._feet.sample(time)
        for error in driver.errors:
            if isinstance(error, FieldError):
                raise error
        return None if self._readings == (None, None) else sample and replace(sample, time=time)

    def _said(self) -> OperatorSample:
        """The last readings as trackers of the feet."""
        left, right = (reading and TrackedPose.of(*reading) for reading in self._readings)
        return OperatorSample(feet=(left, right))
