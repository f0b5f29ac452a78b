"""`Integrator`: held keys, sticks and handles as positions, once a tick. `LiveFeet`: feet, too."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64
from msgspec.structs import replace

from poise.apps.live._inputs import OperatorInputs
from poise.locomotion import (
    FOOT_TURNS,
    TORSO_MOST,
    BodyCommand,
    DeviceStatus,
    FootTracker,
    OperatorSample,
    StepTeleoperator,
    TrackedPose,
    Vector,
    VelocityLimits,
    along_ahead,
    rest_place,
    rotation_of,
    yaw_of,
)

# Height over its place on the ground at which a button holds a foot [m]: an ordinary step
HOLD_HEIGHT = 0.10
_SHARE = 0.85  # part of its limits that a stick commands: feedback needs the rest
_AT_REST = 0.05  # A stick that is no further over commands nothing: none rests at exactly zero
_ORIGIN: Vector = (0.0, 0.0, 0.0)


class BodyLimits(NamedTuple):
    """Ranges of height, torso and feet; those of a robot that is driven are empty."""

    height: tuple[float, float] = (0.0, 0.0)  # [m]
    torso: tuple[float, float, float] = (0.0, 0.0, 0.0)  # roll, pitch and yaw, to either side [rad]
    turns: tuple[float, float] = (0.0, 0.0)  # [rad]

    @classmethod
    def of(cls, teleoperator: StepTeleoperator) -> "BodyLimits":
        """Return those of a robot whose feet are on the ground where it starts."""
        estimator = teleoperator.estimator
        left, right = estimator.anchors
        height = float(estimator.dynamics.com[2] - 0.5 * (left[2] + right[2]))
        # Legs that straighten raise the CoM by 4%.
        reach = (-teleoperator.parameters.stoop_max * height, 0.04 * height)
        turns = teleoperator.actuation != "velocity"
        return cls(reach, TORSO_MOST, FOOT_TURNS) if turns else cls(reach)


class Integrator:
    """Integrate raw samples of page, gamepad or program: a `Device` of hands, body and velocity."""

    def __init__(
        self,
        inputs: OperatorInputs,
        dt: float,
        *,
        limits: BodyLimits | None = None,
        velocities: VelocityLimits | None = None,
    ) -> None:
        self._inputs, self._dt = inputs, dt
        self.limits, self._velocities = limits or BodyLimits(), velocities or VelocityLimits()
        self.body = self._put = BodyCommand()
        self._ways: list[Vector | None] = [None, None]
        self._raw: OperatorSample | None = None

    def sample(self, time: float) -> OperatorSample | None:
        """Return the commands of a tick."""
        raw, before = self._inputs.read(), self._raw
        if raw is None:
            return None
        # A tracker's sample counts once.
        self._raw, came = raw, raw is not before
        self._bend(raw)
        return OperatorSample(
            time=time,
            hands=(self._hand(0, raw, came=came), self._hand(1, raw, came=came)),
            head=raw.head if came else None,
            body=self.body,
            velocity=velocity_of(raw, self._velocities),
            upright=raw.upright,
            rest=raw.rest,
        )

    def _hand(
        self, hand: int, raw: OperatorSample, *, came: bool, speed: float = 0.15
    ) -> TrackedPose | None:
        """Advance a hand by one tick, with a closed clutch, or with keys at a speed [m/s]."""
        seen, way = raw.hands[hand], self._ways[hand]
        if not raw.grip[hand] or (seen is not None and seen.clutch):
            self._ways[hand] = None
            return seen if came else None
        if way is None:
            self._ways[hand] = _ORIGIN
            return TrackedPose(_ORIGIN, clutch=False)
        step = self._dt * speed
        (x, y, z), (forward, left, up) = way, _deflections(raw.reach)
        self._ways[hand] = way = (x + step * forward, y + step * left, z + step * up)
        return TrackedPose(way, clutch=True)

    def _bend(self, raw: OperatorSample, speed: float = 0.06, rate: float = 0.4) -> None:
        """Move height [m/s], and torso and feet [rad/s], at a speed with their keys."""
        if raw.body != self._put:
            self.body = self._put = raw.body
        if raw.neutral:
            self.body = BodyCommand()
        if not any(raw.bend):
            return
        up, *bend, turn = _deflections(raw.bend)
        body, step, limits = self.body, self._dt * rate, self.limits
        (left, right), (inwards, outwards) = body.turns, limits.turns
        if turn and _is_held(raw, 0):
            left = _turned(left + step * turn, right, -inwards, outwards)
        if turn and _is_held(raw, 1):
            right = _turned(right + step * turn, left, -outwards, inwards)
        roll, pitch, yaw = (
            _clipped(angle + step * way, -most, most) if way else angle
            for angle, way, most in zip(body.torso, bend, limits.torso, strict=True)
        )
        height = _clipped(body.height + self._dt * speed * up, *limits.height)
        self.body = BodyCommand(height, (roll, pitch, yaw), (left, right))


class LiveFeet(Integrator):
    """Integrate raw samples to places of both feet, too, in the teleoperator's world."""

    def __init__(self, inputs: OperatorInputs, teleoperator: StepTeleoperator) -> None:
        super().__init__(inputs, teleoperator.dt, limits=BodyLimits.of(teleoperator))
        self._teleoperator = teleoperator
        self.offset = np.zeros(3)  # of the drawn world against the teleoperator's [m]
        self._restart()

    def _restart(self) -> None:
        self.places = [np.array(anchor) for anchor in self._teleoperator.estimator.anchors]
        self._trackers = (FootTracker(), FootTracker())
        # Turns by trackers, to the left of ahead, and the trackers' own turns a tick ago [rad].
        self._turned: list[float | None] = [None, None]
        self._yaws: list[float | None] = [None, None]
        self._walks = False

    def sample(self, time: float) -> OperatorSample | None:
        """Return places of the feet, and all else that is commanded in a tick."""
        sample, raw, status = super().sample(time), self._raw, self._teleoperator.status
        if sample is None or raw is None:
            if status is None or status.device is DeviceStatus.LOST:
                self._restart()
            return None
        left, right = self._foot(0, raw, time), self._foot(1, raw, time)
        if any(raw.lift) or any(part is not None and part.clutch is not False for part in raw.feet):
            self._walks = False
        elif not any(sample.velocity):
            self._walks = True
        velocity = sample.velocity if self._walks else _ORIGIN
        if any(velocity):
            # Who has walked faces ahead.
            self._turned = [None, None]
        body = replace(self.body, turns=self._turns())
        return replace(sample, feet=(left, right), body=body, velocity=velocity)

    def _turns(self) -> tuple[float, float]:
        """Turns of the feet, to the left of ahead [rad]."""
        left, right = (
            commanded if turned is None else turned
            for turned, commanded in zip(self._turned, self.body.turns, strict=True)
        )
        return left, right

    def _foot(self, foot: int, raw: OperatorSample, time: float) -> TrackedPose:
        part, teleoperator = raw.feet[foot], self._teleoperator
        tracker = part if part is not None and part.clutch is not None else None
        led = self._trackers[foot].follow(tracker, self.places[foot], teleoperator.ahead, time)
        before, self._yaws[foot] = self._yaws[foot], None
        if led is not None:
            quaternion = None if tracker is None else tracker.orientation
            rotation = None if quaternion is None else rotation_of(quaternion)
            # A tracker that is upside down has no yaw.
            if rotation is not None and rotation[2, 2] > 0.0:
                self._yaws[foot] = yaw = yaw_of(rotation)
                by = 0.0 if before is None else yaw - before
                self._turned[foot] = math.remainder(self._turns()[foot] + by, math.tau)
            self.places[foot] = np.array(led.position)
            return led
        if _is_held(raw, foot):
            self._turned[foot] = None
            self._integrate(foot, raw)
        else:
            self.places[foot] = np.array(rest_place(teleoperator, foot))
        return TrackedPose.of(self.places[foot])

    def _integrate(
        self,
        foot: int,
        raw: OperatorSample,
        *,
        speed: float = 0.6,
        stick_speed: float = 0.25,
        lead: float = 0.06,
    ) -> None:
        """Move a place for a tick: to its handle, or up by its button and across by the stick."""
        # At the speed of a swing foot, however the mouse jumps. The stick makes a step of 0.25 m in
        # a second, and leads the foot by what it lags behind in a quarter of a second.
        estimator, mode = self._teleoperator.estimator, self._teleoperator.mode
        part, sole = raw.feet[foot], estimator.sole(foot)
        place = _near(self.places[foot], sole)
        if part is not None and part.clutch is None:
            goal = _near(np.array(part.position) - self.offset, sole)
        else:
            x, y, z = estimator.anchors[foot].tolist()
            if mode.single and mode.support != foot:
                both = (raw.move, raw.second)
                stick = np.clip(both[foot] if all(raw.lift) else np.add(*both), -1.0, 1.0).tolist()
                along = along_ahead((*stick, 0.0), self._teleoperator.ahead)[:2]
                goal = place[:2] + self._dt * stick_speed * along
                x, y = np.clip(goal, sole[:2] - lead, sole[:2] + lead).tolist()
                # Across does not wait for up.
                place = np.array([x, y, place[2]])
            goal = np.array([x, y, z + HOLD_HEIGHT])
        self.places[foot] = place + _no_longer(goal - place, self._dt * speed)


def velocity_of(raw: OperatorSample, limits: VelocityLimits) -> Vector:
    """Return the velocity that a sample commands, by itself or by keys and sticks."""
    if any(raw.velocity):
        return raw.velocity
    ahead, left, turn = (0.0 if abs(axis) <= _AT_REST else axis for axis in (*raw.move, raw.turn))
    return (
        _SHARE * ahead * (limits.ahead if ahead > 0.0 else limits.back),
        _SHARE * left * limits.sideways,
        _SHARE * turn * limits.turn,
    )


def _is_held(raw: OperatorSample, foot: int) -> bool:
    part = raw.feet[foot]
    return raw.lift[foot] or (part is not None and part.clutch is None)


def _near(
    goal: Float64[np.ndarray, "3"], sole: Float64[np.ndarray, "3"], lead: float = 0.4
) -> np.ndarray:
    """Limit a position's distance from a sole, to more than a leg reaches [m]."""
    # At the same height, where that is near enough: a foot whose handle is far away stays up.
    way = goal - sole
    up = _clipped(way[2], -lead, lead)
    across = _no_longer(way[:2], math.sqrt(lead**2 - up**2))
    return sole + np.array([*across, up])


def _no_longer(way: Float64[np.ndarray, " n"], most: float) -> Float64[np.ndarray, " n"]:
    """A displacement, shortened to a length [m]; limits by axis would change its direction."""
    length = math.hypot(*way)
    return way if length <= most else most / length * way


def _deflections(sticks: Sequence[float]) -> list[float]:
    return [_clipped(axis, -1.0, 1.0) if math.isfinite(axis) else 0.0 for axis in sticks]


def _clipped(value: float, least: float, most: float) -> float:
    return max(least, min(most, value))


def _turned(turn: float, other: float, least: float, most: float) -> float:
    """A foot's angle within its range against the other one's, from -pi to pi [rad]."""
    against = _clipped(math.remainder(turn - other, math.tau), least, most)
    return math.remainder(other + against, math.tau)
