"""`LiveFeet`: what the operator does, as two foot devices that move smoothly: a `Device`.

`hands_of`: what the operator does with the robot's hands, which take what moves as it comes.
`head_of`: where the operator looks.
"""

import math

import numpy as np
from jaxtyping import Float64

from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._pad import Pad, Quaternion, Tracked
from poise.locomotion import (
    BodySample,
    DeviceSample,
    FootClutch,
    HandSample,
    HeadSample,
    StepTeleoperator,
    VelocityLimits,
    along_ahead,
    rest_place,
    rotation_of,
    yaw_of,
)

HOLD_HEIGHT = 0.10
"""A foot that is lifted by a button is held this far above its place on the ground [m]."""

_SPEED = 0.6
"""A device follows its handle no faster than this [m/s], however the mouse jumps."""
_DOWN_SPEED = 0.15
"""A foot that is let go comes down at this speed [m/s]."""
_STICK_SPEED = 0.25
"""Speed of a lifted foot with the stick all the way over [m/s]."""
_TRACKED_SPEED = 1.5
"""A device follows a tracked hand or foot no faster than this [m/s]."""
_STICK_LEAD = 0.06
"""The stick moves a device no further than this ahead of its foot, along an axis [m]."""
_THERE = 1e-6
"""A device that is no farther from where it is led follows it [m]."""
_HANDLE_LEAD = 0.4
"""A handle, hand or foot is followed no further than this away from the robot's foot [m]: further
than a leg reaches, and near enough to be back within a second."""


class _Turned:
    """How a tracked foot is turned: by what its tracker turned about the vertical while it leads.

    It stays turned when the tracker lets go, until something else leads the foot.

    Attributes:
        angle: to the left of ahead [rad]; None where no tracker has turned it.
    """

    def __init__(self) -> None:
        self.angle: float | None = None
        self._off: float | None = None

    def follow(self, orientation: Quaternion | None, angle: float) -> None:
        """Takes what the tracker says, which leads the foot.

        Args:
            orientation: of the tracker; None where it does not say.
            angle: that is asked of the foot now [rad].
        """
        yaw = None if orientation is None else _yaw_of(orientation)
        if yaw is None:
            self._off = None
            return
        if self._off is None:
            self._off = angle - yaw
        self.angle = math.remainder(self._off + yaw, math.tau)

    def let_go(self) -> None:
        """The tracker does not lead."""
        self._off = None


_LIMITS = VelocityLimits()
"""Of a robot that sticks walk."""


class LiveFeet:
    """Two devices for the feet of a robot, left and right.

    A foot is held by a tracked hand or foot whose clutch is closed, which turns it, too, by
    dragging its handle, or by a button, and then moved by the stick. A foot that is let go comes
    down where it is. Sticks walk the robot while no foot is held, where it takes torques. With both
    feet on the ground a device that holds nothing is on its foot: the handle snaps back after
    landing.

    Args:
        inputs: what the operator does.
        teleoperator: knows where the feet are.

    Attributes:
        offset: from the world that the teleoperator estimates to the drawn one, x, y, z [m].
        places: where the devices are, left and right, in the teleoperator's world [m].
    """

    def __init__(self, inputs: OperatorInputs, teleoperator: StepTeleoperator) -> None:
        self._inputs, self._teleoperator = inputs, teleoperator
        self._dt = teleoperator.parameters.dt
        self.offset: Float64[np.ndarray, "3"] = np.zeros(3)
        self.places = [anchor.copy() for anchor in teleoperator.estimator.anchors]
        self._clutches = (FootClutch(), FootClutch())
        self._turned = (_Turned(), _Turned())
        self._walks = False

    def sample(self, time: float) -> DeviceSample | None:
        """Where the devices are.

        Args:
            time: of the robot [s].

        Returns:
            None while nobody is at the controls.
        """
        pad = self._inputs.read()
        if pad is None:
            # Whoever comes next finds the devices on the feet.
            self.places = [anchor.copy() for anchor in self._teleoperator.estimator.anchors]
            self._clutches = (FootClutch(), FootClutch())
            self._turned = (_Turned(), _Turned())
            self._walks = False
            return None
        rates: list[Float64[np.ndarray, "3"] | None] = [None, None]
        for foot, tracker in enumerate(map(_tracker, pad.tracked)):
            led = self._clutches[foot].follow(
                tracker, self.places[foot], self._teleoperator.ahead, time
            )
            goal, speed, down = self._goal(foot, pad, led)
            way, most = goal - self.places[foot], self._dt * speed
            if down is None:
                step = _no_longer(way, most)
            else:
                up = np.clip(way[2], -self._dt * down, most)
                step = np.array([*_no_longer(way[:2], most), up])
            self.places[foot] = self.places[foot] + step
            if math.dist(self.places[foot], goal) < _THERE:
                rates[foot] = self._clutches[foot].rate(tracker)
        left, right = (place.copy() for place in self.places)
        velocity = self._velocity(pad)
        if any(velocity):
            # Who has walked faces ahead.
            for turned in self._turned:
                turned.angle = None
        return DeviceSample(
            time,
            left,
            right,
            pad.upright,
            hands=hands_of(pad),
            rest=pad.rest,
            body=BodySample(pad.body.height, pad.body.torso, self._turns(pad)),
            velocity=velocity,
            head=head_of(pad),
            rates=(rates[0], rates[1]),
        )

    def _turns(self, pad: Pad) -> tuple[float, float]:
        """How the feet are turned, to the left of ahead [rad]."""
        left, right = (
            asked if turned.angle is None else turned.angle
            for turned, asked in zip(self._turned, pad.body.turns, strict=True)
        )
        return left, right

    def _velocity(self, pad: Pad) -> tuple[float, float, float]:
        """With which the robot walks: sticks that move no foot, and were let go since they did."""
        velocity = velocity_of(pad, _LIMITS)
        tracked = any(t is not None and t.clutch for t in pad.tracked)
        if any(pad.lift) or pad.drag != (None, None) or tracked:
            self._walks = False
        elif not any(velocity):
            self._walks = True
        return velocity if self._walks else (0.0, 0.0, 0.0)

    def _goal(
        self, foot: int, pad: Pad, tracked: Float64[np.ndarray, "3"] | None
    ) -> tuple[Float64[np.ndarray, "3"], float, float | None]:
        """Where a device goes [m], and how fast [m/s]: straight, or across and down by themselves.

        A foot that is let go, or led by a stick, does not wait for one with the other.

        Args:
            foot: 0 left, 1 right.
            pad: what the operator does.
            tracked: where a tracker leads it; None while none does [m].
        """
        estimator, place = self._teleoperator.estimator, self.places[foot]
        anchor, drag, sole = estimator.anchors[foot], pad.drag[foot], estimator.sole(foot)
        turned = self._turned[foot]
        if tracked is not None:
            seen = pad.tracked[foot]
            turned.follow(None if seen is None else seen.orientation, self._turns(pad)[foot])
            return _near(tracked, sole), _TRACKED_SPEED, None
        turned.let_go()
        if drag is not None or pad.lift[foot]:
            turned.angle = None
        if drag is not None:
            return _near(np.array(drag) - self.offset, sole), _SPEED, None
        mode = self._teleoperator.mode
        in_air = mode.single and mode.support != foot
        if pad.lift[foot]:
            height = anchor[2] + HOLD_HEIGHT
            if not in_air:
                return np.array([anchor[0], anchor[1], height]), _SPEED, None
            along = along_ahead((*_stick(pad, foot), 0.0), self._teleoperator.ahead)[:2]
            moved = place[:2] + self._dt * _STICK_SPEED * along
            moved = np.clip(moved, sole[:2] - _STICK_LEAD, sole[:2] + _STICK_LEAD)
            return np.array([*moved, height]), _SPEED, _SPEED
        return rest_place(self._teleoperator, foot), _SPEED, _DOWN_SPEED if in_air else None


def _yaw_of(orientation: Quaternion) -> float | None:
    """How a tracker is turned, to the left [rad]; None for no rotation, or one upside down."""
    rotation = rotation_of(np.array(orientation, dtype=np.float64))
    return None if rotation is None or rotation[2, 2] <= 0.0 else yaw_of(rotation)


_SHARE = 0.85
"""Of the limits that a stick asks for when it is all the way over."""

_AT_REST = 0.05
"""A stick that is no further over asks for nothing: none rests at exactly zero."""


def velocity_of(pad: Pad | None, limits: VelocityLimits) -> tuple[float, float, float]:
    """The velocity that keys and sticks ask for.

    Args:
        pad: what the operator does; None for nobody, who asks for rest.
        limits: of velocities; a stick all the way over asks for most of them.

    Returns:
        Ahead [m/s], to the left [m/s], turning to the left [rad/s].
    """
    if pad is None:
        return 0.0, 0.0, 0.0
    ahead, left, turn = (0.0 if abs(axis) <= _AT_REST else axis for axis in (*pad.move, pad.turn))
    return (
        _SHARE * ahead * (limits.ahead if ahead > 0.0 else limits.back),
        _SHARE * left * limits.sideways,
        _SHARE * turn * limits.turn,
    )


def hands_of(pad: Pad) -> tuple[HandSample | None, HandSample | None]:
    """What the operator does with the robot's hands."""
    left, right = map(_tracker, pad.hands)
    return left, right


def _tracker(seen: Tracked | None) -> HandSample | None:
    if seen is None:
        return None
    turned = None if seen.orientation is None else np.array(seen.orientation, dtype=np.float64)
    rate = None if seen.velocity is None else np.array(seen.velocity, dtype=np.float64)
    return HandSample(np.array(seen.position, dtype=np.float64), seen.clutch, turned, rate)


def head_of(pad: Pad) -> HeadSample | None:
    """Where the operator looks."""
    if pad.head is None:
        return None
    return HeadSample(np.array(pad.head.orientation, dtype=np.float64), pad.head.clutch)


def _near(goal: Float64[np.ndarray, "3"], sole: Float64[np.ndarray, "3"]) -> np.ndarray:
    """A place, no further from a sole than anything may lead it.

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


def _stick(pad: Pad, foot: int) -> Float64[np.ndarray, "2"]:
    """Where a foot is led by sticks, forward and left, from -1 to 1."""
    if all(pad.lift):
        return np.array((pad.move, pad.second)[foot])
    return np.clip(np.add(pad.move, pad.second), -1.0, 1.0)
