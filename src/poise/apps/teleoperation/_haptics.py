"""Two arms with force feedback: one for each foot, read and driven at their own rate.

`HapticDriver`: from what feet feel to what hands feel. `HapticFeet`: the arms as a `Device`.
"""

import math
import time as clock
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from msgspec.structs import replace

from poise._checks import checked_number
from poise.apps.teleoperation._haptic_arms import HapticArm, Reading
from poise.dynamics import saturate
from poise.errors import ConfigurationError
from poise.locomotion import (
    FieldError,
    OperatorSample,
    StepTeleoperator,
    TrackedFeet,
    TrackedPose,
    WarnOnce,
    along_ahead,
    checked_reading,
)

# What the left and the right arm said; None for one that is gone, fails or is nowhere
Readings = tuple[Reading | None, Reading | None]

# A foot with less than this part of both feet's load for so long [s] is in the air: as the
# weight begins to shift to it, the load of one that stands may be gone for a moment
_UNLOADED, _LIFTED = 0.05, 0.05
# Part of a landed foot's force that has to be washed out for the foot to count as standing
_SETTLED = 0.9
_LEAST = 1e-3  # A force that is nearer than this to where it goes is there [N]


class _Hand:
    """A hand at an arm whose driver may fail, and the force of its foot on it."""

    def __init__(
        self, arm: HapticArm, side: str, *, dt: float, gain: float, most: float,
        smoothing: float, washout: float,
    ) -> None:  # fmt: skip
        self._arm, self._side, self._dt = arm, side, dt
        self._gain, self._most = gain, most
        self._smoothing, self._washout = smoothing, washout
        self._in_air, self._without = False, 0.0
        self._slow = self._force = np.zeros(3)
        self.error: Exception | None = None
        self._warn_once = WarnOnce()

    def tick(self, foot: Float64[np.ndarray, "3"], total: float, *, heard: bool) -> Reading | None:
        """Read and drive the arm, with forces on the foot and on both [N]; None where it fails."""
        self.error = None
        reading, touch = self._read(), self._touch(foot, total)
        holds = reading is not None and reading[1] and heard
        self._approach(saturate(self._most, self._gain * touch) if holds else np.zeros(3))
        try:
            self._arm.write(self._force.copy() if reading is not None else np.zeros(3))
        except Exception as error:
            self._fail(error)
            # It is back as softly as at the beginning.
            self._force = np.zeros(3)
            return None
        return reading

    def _read(self) -> Reading | None:
        try:
            reading = checked_reading(f"{self._side} arm", self._arm.read())
        except Exception as error:
            self._fail(error)
            return None
        if reading is None or reading.position is None:
            return None
        place = np.array(reading.position)
        return (place, bool(reading.clutch)) if np.isfinite(place).all() else None

    def _fail(self, error: Exception) -> None:
        # The first one: what fails after it often does so because of it.
        self.error = self.error or error
        self._warn_once(error, "the %s arm failed, and counts as gone", self._side)

    def _touch(self, force: Float64[np.ndarray, "3"], total: float) -> Float64[np.ndarray, "3"]:
        """Force on a foot in the air and at its landing, washed out [N]."""
        unloaded = bool(force[2] < _UNLOADED * total)
        self._without = self._without + self._dt if unloaded else 0.0
        if self._without > _LIFTED:
            self._in_air, self._slow = True, np.zeros(3)
        if not self._in_air:
            return np.zeros(3)
        if not unloaded:
            self._slow = self._slow + self._dt / (self._washout + self._dt) * (force - self._slow)
            self._in_air = bool(self._slow[2] < _SETTLED * force[2])
        return force - self._slow

    def _approach(self, goal: Float64[np.ndarray, "3"]) -> None:
        left = (goal - self._force) * self._smoothing / (self._smoothing + self._dt)
        # Nothing is nothing at last.
        self._force = goal - left if math.sqrt(float(left @ left)) > _LEAST else goal


# Whoever ticks no more for so long has ended [s]: hands that nobody reads lead nothing
_ENDED = 0.1


class HapticDriver:
    """Reads two arms and lets each hand feel what its foot meets.

    At the arms' rate, whatever that of the robot: in between the last force of the feet holds. The
    force on a hand is a fraction of what its foot meets in the air or lands on, smoothed, fading
    after the landing, and never more than `force_max`. It goes to zero where nothing has been heard
    from the robot for `silence`, where the clutch is open, and where the arm is gone, fails or says
    that it is nowhere. An arm that fails takes nothing from the other one.

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
        errors: what the left and the right arm raised in the last period, or a `TypeError` of what
            was no place and clutch; None if all was well.
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
        self.dt = checked_number(dt, "period of the arms [s]", above=0.0)
        self._silence = checked_number(silence, "silence of the robot [s]", above=0.0)
        left_hand, right_hand = (
            _Hand(
                arm,
                side,
                dt=self.dt,
                gain=checked_number(gain, "gain of the forces", above=0.0),
                most=checked_number(force_max, "force_max of the arms [N]", above=0.0),
                smoothing=checked_number(smoothing, "smoothing of the forces [s]", above=0.0),
                washout=checked_number(washout, "washout of the forces [s]", above=0.0),
            )
            for side, arm in (("left", left), ("right", right))
        )
        self._hands = (left_hand, right_hand)
        # In one object, which another thread replaces as a whole.
        self._news: tuple[float, Float64[np.ndarray, "2 3"]] = (-math.inf, np.zeros((2, 3)))
        self._known, self._unheard = self._news, 0
        self.errors: tuple[Exception | None, Exception | None] = (None, None)
        # Likewise; with when they were read, on the clock of this machine.
        self._read: tuple[float, Readings] = (-math.inf, (None, None))

    @property
    def readings(self) -> Readings:
        """What the arms said last, left and right; None for one that is gone, fails or is nowhere.

        None for both where no `tick` has come for 0.1 s, or for two periods if those are longer: a
        thread that has ended holds no foot up.
        """
        read_at, readings = self._read
        patience = max(_ENDED, 2.0 * self.dt)
        return readings if clock.monotonic() - read_at <= patience else (None, None)

    def feel(self, forces: Sequence[Sequence[float]], now: float) -> None:
        """News from the robot; what is not finite is none.

        Args:
            forces: of the ground on the left and the right foot: forward, left, up [N].
            now: on the clock that `tick` is given [s].
        """
        array = np.array(forces, dtype=np.float64)
        if array.shape != (2, 3):
            raise ConfigurationError(
                "no forces of two feet", got=array.shape, wanted="two rows: forward, left, up"
            )
        if np.isfinite(array).all():
            self._news = (now, array)

    def tick(self, now: float) -> Readings:
        """One period of the arms; an arm that raises counts as gone.

        Args:
            now: on any clock [s].

        Returns:
            What `readings` gives now.
        """
        news = heard_at, feet = self._news
        # Periods are counted, too: by a clock that stands still or has gone back nobody is silent.
        self._unheard = self._unheard + 1 if news is self._known else 0
        self._known = news
        heard = now - heard_at <= self._silence and self._unheard * self.dt <= self._silence
        total = float(feet[:, 2].sum())
        left, right = self._hands
        said = left.tick(feet[0], total, heard=heard), right.tick(feet[1], total, heard=heard)
        self.errors, self._read = (left.error, right.error), (clock.monotonic(), said)
        return said


def foot_forces(teleoperator: StepTeleoperator) -> list[list[float]]:
    """What the feet measured in the last tick, left and right: forward, left, up [N]."""
    dynamics = teleoperator.estimator.dynamics
    soles = teleoperator.soles
    felt = [dynamics.state.wrench(sole) for sole in soles]
    turns = [dynamics.frame(teleoperator.robot.frame_id(sole)).rotation for sole in soles]
    in_world = [
        (0.0, 0.0, 0.0) if wrench is None else (turn @ wrench[:3]).tolist()
        for turn, wrench in zip(turns, felt, strict=True)
    ]
    return [along_ahead(force, -teleoperator.ahead).tolist() for force in in_world]


# A clock of the robot that goes on or back by more than this has jumped [s]: the arms go on
# from where it is now
_PAUSE = 0.1


class HapticFeet:
    """Two arms as a `Device`: each leads its foot by how it moves while its clutch is closed.

    For simulated arms: real ones want a thread of their own that calls `HapticDriver.tick` at their
    rate. Each tick of the robot both are driven up to its time, period by period. A clutch takes
    hold where the device is: on the foot. It has to be seen open before: one that is closed at the
    beginning, or when an arm that was gone is back, leads nothing. Forward is where the robot faces
    when it takes hold.

    Args:
        driver: of the arms.
        teleoperator: whose feet are led and felt.
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
        """Where the hands lead the feet; the foot of an arm that is gone comes down where it is.

        Args:
            time: of the robot [s].

        Returns:
            None while both arms are gone.

        Raises:
            TypeError: what an arm said in its last period is no place and clutch.
        """
        driver = self.driver
        driver.feel(foot_forces(self._teleoperator), time)
        if abs(time - self._next) > _PAUSE:
            self._begin, self._periods = time, 0
        while self._next <= time:
            # Not `driver.readings`: a slow computer would let go of a simulated robot's feet.
            self._readings = driver.tick(self._next)
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

    @property
    def _next(self) -> float:
        """When the arms' next period begins [s]."""
        return self._begin + self._periods * self.driver.dt
