"""Two arms with force feedback: one for each foot, read and driven at their own rate.

`HapticArm`: what a driver of a device has to have. `SimulatedArm`: one in a simulated hand.
`HapticDriver`: from what feet feel to what hands feel. `HapticFeet`: the arms as a `Device`.
"""

import math
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise.dynamics import saturate
from poise.errors import ConfigurationError
from poise.locomotion import (
    DeviceSample,
    FootClutch,
    HandSample,
    StepTeleoperator,
    along_ahead,
    rest_place,
)

Reading = tuple[Float64[np.ndarray, "3"], bool]
"""Where the end of an arm is, forward, left and up from anywhere [m], and whether it leads."""


@runtime_checkable
class HapticArm(Protocol):
    """A device of three degrees of freedom that one hand holds, such as a Novint Falcon.

    Neither call may wait: both are made once a period of the device, a thousand times a second.
    """

    def read(self) -> Reading | None:
        """Where the hand is and whether its clutch is closed; None when the arm is gone.

        So it is, too, for a place that is not finite.
        """
        ...

    def write(self, force: Float64[np.ndarray, "3"]) -> None:
        """Pushes the hand until the next call.

        Args:
            force: forward, left and up [N].
        """
        ...


class SimulatedArm:
    """An arm in a hand that holds it like a spring and goes where a person wants it to.

    m x'' = f + k (x_hand - x) - d x' with the force f of the device; each `read` is a period later.

    Args:
        hand: where the person wants the hand at a time [s], and whether the clutch is closed.
        dt: period [s].
        mass: of arm and hand m [kg].
        stiffness: of a relaxed hand k [N/m].
        damping: of hand and arm d [N s/m].

    Attributes:
        force: of the device on the hand now [N].
        connected: whether it can be read; a test may pull it out.
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
        self._dt = checked_number(dt, "period of the arm [s]", above=0.0)
        self._mass = checked_number(mass, "mass of the arm [kg]", above=0.0)
        self._stiffness = checked_number(stiffness, "stiffness of the hand [N/m]", above=0.0)
        self._damping = checked_number(damping, "damping of the hand [N s/m]", above=0.0)
        self._hand, self._periods = hand, 0
        self._position = hand(0.0)[0].copy()
        self._velocity = np.zeros(3)
        self.force: Float64[np.ndarray, "3"] = np.zeros(3)
        self.connected = True

    def read(self) -> Reading | None:
        """Where the hand is, a period after the last call."""
        wanted, clutch = self._hand(self._periods * self._dt)
        pull = self._stiffness * (wanted - self._position) - self._damping * self._velocity
        # The velocity first: with the old one the spring would gain energy.
        self._velocity = self._velocity + self._dt / self._mass * (self.force + pull)
        self._position = self._position + self._dt * self._velocity
        self._periods += 1
        return (self._position.copy(), clutch) if self.connected else None

    def write(self, force: Float64[np.ndarray, "3"]) -> None:
        """Pushes the hand until the next call [N]."""
        self.force = force.copy()


_UNLOADED, _LIFTED = 0.05, 0.05
"""A foot with less than this part of both feet's load for so long [s] is in the air: as the weight
begins to shift to it, the load of one that stands may be gone for a moment."""
_SETTLED = 0.9
"""Part of a landed foot's force that has to be washed out for the foot to count as standing."""
_LEAST = 1e-3
"""A force that is nearer than this to where it goes is there [N]."""


class _Touch:
    """What one foot's force is to the hand: what it meets in the air, and its landing.

    A foot that stands is not felt: a hand that is pushed up by a load that lasts would lift it.

    Args:
        washout: time constant with which a landing fades [s].
    """

    def __init__(self, washout: float) -> None:
        self._washout = washout
        self._in_air, self._without = False, 0.0
        self._slow: Float64[np.ndarray, "3"] = np.zeros(3)

    def felt(
        self, force: Float64[np.ndarray, "3"], total: float, dt: float
    ) -> Float64[np.ndarray, "3"]:
        """One period.

        Args:
            force: on the foot [N].
            total: what both feet carry [N].
            dt: period [s].
        """
        unloaded = bool(force[2] < _UNLOADED * total)
        self._without = self._without + dt if unloaded else 0.0
        if self._without > _LIFTED:
            self._in_air, self._slow = True, np.zeros(3)
        if not self._in_air:
            return np.zeros(3)
        if not unloaded:
            self._slow = self._slow + dt / (self._washout + dt) * (force - self._slow)
            self._in_air = bool(self._slow[2] < _SETTLED * force[2])
        return force - self._slow


class HapticDriver:
    """Reads two arms and lets each hand feel what its foot meets.

    At the arms' rate, whatever that of the robot: in between the last force of the feet holds. The
    force on a hand is a fraction of what its foot meets in the air or lands on, smoothed, fading
    after the landing, and never more than `force_max`. It goes to zero where nothing has been heard
    from the robot for `silence`, where the clutch is open, and where the arm is gone or says that
    it is nowhere.

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
        readings: what the arms said last, left and right; None for one that is gone or nowhere.
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
        self._arms = (left, right)
        self.dt = checked_number(dt, "period of the arms [s]", above=0.0)
        self._gain = checked_number(gain, "gain of the forces", above=0.0)
        self._most = checked_number(force_max, "force_max of the arms [N]", above=0.0)
        self._smoothing = checked_number(smoothing, "smoothing of the forces [s]", above=0.0)
        self._silence = checked_number(silence, "silence of the robot [s]", above=0.0)
        washout = checked_number(washout, "washout of the forces [s]", above=0.0)
        self._touches = (_Touch(washout), _Touch(washout))
        self._forces = [np.zeros(3), np.zeros(3)]
        # In one object, which another thread replaces as a whole.
        self._news: tuple[float, Float64[np.ndarray, "2 3"]] = (-math.inf, np.zeros((2, 3)))
        self._known, self._unheard = self._news, 0
        self.readings: tuple[Reading | None, Reading | None] = (None, None)

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

    def tick(self, now: float) -> None:
        """One period of the arms.

        Args:
            now: on any clock [s].
        """
        news = heard_at, feet = self._news
        # Periods are counted, too: by a clock that stands still or has gone back nobody is silent.
        self._unheard = self._unheard + 1 if news is self._known else 0
        self._known = news
        heard = now - heard_at <= self._silence and self._unheard * self.dt <= self._silence
        total = float(feet[:, 2].sum())
        readings: list[Reading | None] = []
        for foot, arm in enumerate(self._arms):
            reading = _valid(arm.read())
            felt = self._touches[foot].felt(feet[foot], total, self.dt)
            holds = reading is not None and reading[1] and heard
            goal = saturate(self._most, self._gain * felt) if holds else np.zeros(3)
            self._forces[foot] = self._smoothed(self._forces[foot], goal)
            arm.write(self._forces[foot] if reading is not None else np.zeros(3))
            readings.append(reading)
        self.readings = (readings[0], readings[1])

    def _smoothed(
        self, force: Float64[np.ndarray, "3"], goal: Float64[np.ndarray, "3"]
    ) -> Float64[np.ndarray, "3"]:
        left = (goal - force) * self._smoothing / (self._smoothing + self.dt)
        # Nothing is nothing at last.
        return goal - left if math.sqrt(float(left @ left)) > _LEAST else goal


def _valid(reading: Reading | None) -> Reading | None:
    """A reading that says where the hand is; None for one that does not."""
    return reading if reading is not None and np.isfinite(reading[0]).all() else None


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


_PAUSE = 0.1
"""A clock of the robot that goes on or back by more than this has jumped [s]: the arms go on from
where it is now."""


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
        self._clutches = (FootClutch(scale), FootClutch(scale))
        self._places = [rest_place(teleoperator, foot) for foot in (0, 1)]
        self._begin, self._periods = 0.0, 0

    def sample(self, time: float) -> DeviceSample | None:
        """Where the hands lead the feet; None while an arm is gone.

        Args:
            time: of the robot [s].
        """
        driver = self.driver
        driver.feel(foot_forces(self._teleoperator), time)
        if abs(time - self._next) > _PAUSE:
            self._begin, self._periods = time, 0
        while self._next <= time:
            driver.tick(self._next)
            self._periods += 1
        left, right = driver.readings
        if left is None or right is None:
            for foot, clutch in enumerate(self._clutches):
                clutch.follow(None, self._places[foot], 0.0, time)
            return None
        return DeviceSample(time, self._led(0, left, time), self._led(1, right, time))

    @property
    def _next(self) -> float:
        """When the arms' next period begins [s]."""
        return self._begin + self._periods * self.driver.dt

    def _led(self, foot: int, reading: Reading, time: float) -> Float64[np.ndarray, "3"]:
        teleoperator, place = self._teleoperator, self._places[foot]
        sample, ahead = HandSample(*reading), teleoperator.ahead
        led = self._clutches[foot].follow(sample, place, ahead, time)
        self._places[foot] = rest_place(teleoperator, foot) if led is None else led
        return self._places[foot].copy()
