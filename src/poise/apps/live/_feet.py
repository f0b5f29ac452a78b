"""`LiveFeet`: keys, sticks, handles and trackers as places of two feet: a `Device`.

`velocity_of`: the velocity that keys and sticks command.
"""

import math

import numpy as np
from jaxtyping import Float64
from msgspec.structs import replace

from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._odometry import Odometry
from poise.locomotion import (
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

HOLD_HEIGHT = 0.10
"""Height over its place on the ground at which a button holds a foot [m]: an ordinary step."""

_SPEED = 0.6
"""Speed at which a foot goes to its handle [m/s], however the mouse jumps: that of a swing foot."""
_STICK_SPEED = 0.25
"""Speed of a lifted foot with the stick all the way over [m/s]: a step of 0.25 m takes a second."""
_STICK_LEAD = 0.06
"""Distance to which the stick moves a place ahead of its foot, along an axis [m]: what a foot at
that speed lags behind by in a quarter of a second."""
_HANDLE_LEAD = 0.4
"""Distance to which a handle leads from the robot's foot [m]: further than a leg reaches, and near
enough to be back within a second at `_SPEED`."""


_LIMITS = VelocityLimits()
"""Of a robot that sticks walk."""


class LiveFeet:
    """Integrate raw samples to places of both feet, in the teleoperator's world, and a velocity.

    A foot follows a tracker whose clutch is closed, which turns it, too, until something else does;
    a handle; or a button, and then the stick. Otherwise it is lowered where it is. Sticks walk the
    robot while no foot is held.

    Args:
        inputs: what the operator does.
        teleoperator: knows where the feet are.
        odometry: of the drawn world, in which handles are.

    Attributes:
        places: of the left and the right foot's device, in the teleoperator's world [m].
    """

    def __init__(
        self, inputs: OperatorInputs, teleoperator: StepTeleoperator, odometry: Odometry
    ) -> None:
        self._inputs, self._teleoperator, self._odometry = inputs, teleoperator, odometry
        self._dt = teleoperator.parameters.dt
        self._restart()

    def _restart(self) -> None:
        """Whoever comes next finds the devices on the feet."""
        self.places = [np.array(anchor) for anchor in self._teleoperator.estimator.anchors]
        self._trackers = (FootTracker(), FootTracker())
        # Turns by trackers, to the left of ahead, and the trackers' own turns a tick ago [rad].
        self._turned: list[float | None] = [None, None]
        self._yaws: list[float | None] = [None, None]
        self._walks = False

    def sample(self, time: float) -> OperatorSample | None:
        """Return where the devices are.

        Args:
            time: of the robot [s].

        Returns:
            None while nobody is at the controls.
        """
        raw = self._inputs.read()
        if raw is None:
            self._restart()
            return None
        left, right = self._foot(0, raw, time), self._foot(1, raw, time)
        velocity = self._velocity(raw)
        if any(velocity):
            # Who has walked faces ahead.
            self._turned = [None, None]
        return OperatorSample(
            time=time,
            feet=(left, right),
            hands=raw.hands,
            head=raw.head,
            body=replace(raw.body, turns=self._turns(raw)),
            velocity=velocity,
            upright=raw.upright,
            rest=raw.rest,
        )

    def _turns(self, raw: OperatorSample) -> tuple[float, float]:
        """Turns of the feet, to the left of ahead [rad]."""
        left, right = (
            commanded if turned is None else turned
            for turned, commanded in zip(self._turned, raw.body.turns, strict=True)
        )
        return left, right

    def _velocity(self, raw: OperatorSample) -> Vector:
        """Velocity of sticks that move no foot, and were let go since they did."""
        velocity = velocity_of(raw, _LIMITS)
        if any(raw.lift) or any(part is not None and part.clutch is not False for part in raw.feet):
            self._walks = False
        elif not any(velocity):
            self._walks = True
        return velocity if self._walks else (0.0, 0.0, 0.0)

    def _foot(self, foot: int, raw: OperatorSample, time: float) -> TrackedPose:
        """One tick of a foot's device."""
        part, teleoperator = raw.feet[foot], self._teleoperator
        tracker = part if part is not None and part.clutch is not None else None
        handle = part.position if part is not None and part.clutch is None else None
        led = self._trackers[foot].follow(tracker, self.places[foot], teleoperator.ahead, time)
        before, self._yaws[foot] = self._yaws[foot], None if led is None else _yaw_of(tracker)
        if led is not None:
            yaw = self._yaws[foot]
            if yaw is not None:
                by = 0.0 if before is None else yaw - before
                self._turned[foot] = math.remainder(self._turns(raw)[foot] + by, math.tau)
            self.places[foot] = np.array(led.position)
            return led
        if handle is not None or raw.lift[foot]:
            self._turned[foot] = None
            self._integrate(foot, raw, handle)
        else:
            self.places[foot] = np.array(rest_place(teleoperator, foot))
        return TrackedPose.of(self.places[foot])

    def _integrate(self, foot: int, raw: OperatorSample, handle: Vector | None) -> None:
        """Move a place for a tick: to its handle, or up by its button and across by the stick."""
        estimator, mode = self._teleoperator.estimator, self._teleoperator.mode
        sole = estimator.sole(foot)
        place = _near(self.places[foot], sole)
        if handle is not None:
            goal = _near(self._odometry.estimated(np.array(handle)), sole)
        else:
            x, y, z = estimator.anchors[foot].tolist()
            if mode.single and mode.support != foot:
                along = along_ahead((*_stick(raw, foot), 0.0), self._teleoperator.ahead)[:2]
                x, y = np.clip(
                    place[:2] + self._dt * _STICK_SPEED * along,
                    sole[:2] - _STICK_LEAD,
                    sole[:2] + _STICK_LEAD,
                ).tolist()
                # Across does not wait for up.
                place = np.array([x, y, place[2]])
            goal = np.array([x, y, z + HOLD_HEIGHT])
        self.places[foot] = place + _no_longer(goal - place, self._dt * _SPEED)


def _yaw_of(tracker: TrackedPose | None) -> float | None:
    """How a tracker is turned, to the left [rad]; None for no rotation, or one upside down."""
    quaternion = None if tracker is None else tracker.orientation
    rotation = None if quaternion is None else rotation_of(quaternion)
    return None if rotation is None or rotation[2, 2] <= 0.0 else yaw_of(rotation)


_SHARE = 0.85
"""Part of its limits at which a robot walks with the stick all the way over: feedback needs the
rest."""

_AT_REST = 0.05
"""A stick that is no further over commands nothing: none rests at exactly zero."""


def velocity_of(raw: OperatorSample | None, limits: VelocityLimits) -> Vector:
    """Return the velocity that a sample commands, by itself or by keys and sticks.

    Args:
        raw: what the operator does; None for nobody, who commands rest.
        limits: of velocities; a stick all the way over commands most of them.

    Returns:
        Ahead [m/s], to the left [m/s], turning to the left [rad/s].
    """
    if raw is None or any(raw.velocity):
        return (0.0, 0.0, 0.0) if raw is None else raw.velocity
    ahead, left, turn = (
        0.0 if abs(axis) <= _AT_REST else max(-1.0, min(1.0, axis))
        for axis in (*raw.move, raw.turn)
    )
    return (
        _SHARE * ahead * (limits.ahead if ahead > 0.0 else limits.back),
        _SHARE * left * limits.sideways,
        _SHARE * turn * limits.turn,
    )


def _near(goal: Float64[np.ndarray, "3"], sole: Float64[np.ndarray, "3"]) -> np.ndarray:
    """A place, no further from a sole than a handle may lead it.

    At the same height, where that is near enough: a foot whose handle is far away stays up.
    """
    way = goal - sole
    up = max(-_HANDLE_LEAD, min(_HANDLE_LEAD, way[2]))
    across = _no_longer(way[:2], math.sqrt(_HANDLE_LEAD**2 - up**2))
    return sole + np.array([*across, up])


def _no_longer(way: Float64[np.ndarray, " n"], most: float) -> Float64[np.ndarray, " n"]:
    """A way, along itself no longer than a length [m]: limits on its axes would bend it."""
    length = math.hypot(*way)
    return way if length <= most else most / length * way


def _stick(raw: OperatorSample, foot: int) -> Float64[np.ndarray, "2"]:
    """Return the direction in which sticks move a foot, forward and left, from -1 to 1."""
    both = (raw.move, raw.second)
    return np.clip(both[foot] if all(raw.lift) else np.add(*both), -1.0, 1.0).astype(np.float64)
