"""`DeviceSample`: what the operator commands at a time, and `DeviceStatus`: what became of it.

`HandSample`: what is commanded of a hand. `HeadSample`: of the gaze. `BodySample`: of the body, and
how feet are turned.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from jaxtyping import Float64

from poise.locomotion._stepping._operator._fields import (
    FieldError,
    Vectors,
    flag,
    number,
    numbers,
    of_kind,
    pair,
)


@dataclass(frozen=True, slots=True, eq=False)
class HandSample:
    """Where the operator holds the device of one hand; its motion is what counts.

    Attributes:
        position: forward, left and up, as the robot's torso faces, from anywhere that stays where
            it is [m].
        clutch: whether the hand follows. Whoever wants to reach further lets go, moves back, and
            takes hold anew; the hand stays where it is in between.
        orientation: how the device is turned against those axes, a unit quaternion (x, y, z, w);
            None for one that says nothing of it, whose hand is not turned. As the position: the
            rotation R_t R_0^T since the clutch closed at R_0 turns the hand, not scaled.
        velocity: of the device along the same axes [m/s]; None for one that does not say, whose
            hand lags behind it.
    """

    position: Float64[np.ndarray, "3"]
    clutch: bool = True
    orientation: Float64[np.ndarray, "4"] | None = None
    velocity: Float64[np.ndarray, "3"] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class HeadSample:
    """Where the operator looks.

    It is not relative, as hands are: who wears a headset knows where ahead is, and a horizon or an
    ahead that is off by what each new grip adds makes them sick. What is ahead, the headset's own
    software says, where a person can set it anew. The clutch says whether the robot follows; where
    it closes, the gaze goes to where the operator looks, no faster than it may.

    Attributes:
        orientation: of the head against looking straight ahead, a unit quaternion (x, y, z, w)
            along forward, left and up as the robot's torso faces.
        clutch: whether the gaze follows; it stays where it is while that is open.
    """

    orientation: Float64[np.ndarray, "4"]
    clutch: bool = True


@dataclass(frozen=True, slots=True)
class BodySample:
    """What is commanded beside where feet and hands are; all zero asks for nothing.

    Attributes:
        height: of the COM, over the usual one [m].
        torso: roll, pitch and yaw against upright and facing as the feet do; where torques are
            commanded [rad].
        turns: how the left and the right foot are turned, to the left of ahead
            (`StepTeleoperator.ahead`); where torques are commanded [rad].
    """

    height: float = 0.0
    torso: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turns: tuple[float, float] = (0.0, 0.0)

    @property
    def numbers(self) -> tuple[float, float, float, float, float, float]:
        """Height, roll, pitch, yaw, and both turns."""
        return (self.height, *self.torso, *self.turns)


@dataclass(frozen=True, slots=True, eq=False)
class DeviceSample:
    """Where the operator holds the devices: two for the feet, each of the sole of its side.

    Attributes:
        time: when it was measured, on the operator's clock [s].
        left: position commanded for the left sole, in the controller's world [m].
        right: position commanded for the right sole [m].
        upright: button: bring the torso upright although one foot is in the air.
        hands: what is commanded of the left and of the right hand; None for a hand without a
            device, which stays as it is.
        rest: button: hands that are not held go back to rest, and so does the gaze.
        body: what is commanded of the body, and how the feet are turned.
        velocity: with which the robot walks by itself, ahead, to the left [m/s] and turning to the
            left [rad/s]; all zero while the operator steps. Where torques are commanded.
        head: where the operator looks; None without a headset: the gaze stays where it is.
        rates: velocities of the left and of the right foot's device [m/s]; None for one that does
            not say, whose foot lags behind it.
    """

    time: float
    left: Float64[np.ndarray, "3"]
    right: Float64[np.ndarray, "3"]
    upright: bool = False
    hands: tuple[HandSample | None, HandSample | None] = (None, None)
    rest: bool = False
    body: BodySample = BodySample()
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    head: HeadSample | None = None
    rates: tuple[Float64[np.ndarray, "3"] | None, Float64[np.ndarray, "3"] | None] = (None, None)

    def position(self, foot: int) -> Float64[np.ndarray, "3"]:
        """Position commanded for a sole: 0 left, 1 right [m]."""
        return self.left if foot == 0 else self.right


def checked_sample(sample: object) -> tuple[DeviceSample | None, FieldError | None]:
    """What a device has given, which may be anything; all of its numbers as float64.

    A place or an orientation that is none becomes NaN, and the rest counts: a device that is out
    of sight takes nothing with it. What is not finite, far away or no unit quaternion is left to
    those who follow it, and refuse it one by one.

    Args:
        sample: as given; None for nothing new.

    Returns:
        The sample, and what in it is no place or orientation; None for nothing.

    Raises:
        FieldError: it is no sample, or something else in it is of another kind.
        OverflowError: a whole number in it that is too large for a float.
    """
    if sample is None:
        return None, None
    sample = of_kind("sample", sample, DeviceSample)
    body = of_kind("body", sample.body, BodySample)
    time = number("time", sample.time)
    ahead, aside, turning = numbers("velocity", sample.velocity, 3)
    height = number("height", body.height)
    roll, pitch, yaw = numbers("torso", body.torso, 3)
    left_turn, right_turn = numbers("turns", body.turns, 2)
    left_hand, right_hand = pair("hands", sample.hands)
    left_rate, right_rate = pair("rates", sample.rates)
    read = Vectors()
    head = sample.head
    if head is not None:
        head = of_kind("head", head, HeadSample)
        turned = read.vector("orientation of head", head.orientation, 4)
        head = HeadSample(turned, flag("clutch of head", head.clutch))
    good = DeviceSample(
        time,
        left=read.vector("left", sample.left, 3),
        right=read.vector("right", sample.right, 3),
        upright=flag("upright", sample.upright),
        hands=(_hand(read, "left hand", left_hand), _hand(read, "right hand", right_hand)),
        rest=flag("rest", sample.rest),
        body=BodySample(height, (roll, pitch, yaw), (left_turn, right_turn)),
        velocity=(ahead, aside, turning),
        head=head,
        rates=(read.maybe("rates", left_rate, 3), read.maybe("rates", right_rate, 3)),
    )
    return good, read.error


def checked_tracker(side: str, tracker: object) -> tuple[HandSample | None, FieldError | None]:
    """What a tracker says, its numbers as float64; NaN in the place of what are none.

    Args:
        side: whose foot it leads: "left" or "right".
        tracker: of the foot; None where it is gone.

    Returns:
        The tracker, and what in it are no numbers; None for nothing.

    Raises:
        FieldError: what came is something else.
    """
    read = Vectors()
    return _hand(read, f"{side} tracker", tracker), read.error


def checked_reading(arm: str, reading: object) -> tuple[Float64[np.ndarray, "3"], bool] | None:
    """What an arm of a foot says: its place as float64, and whether its clutch is closed.

    Args:
        arm: its name.
        reading: as given; None where it is gone. A place of None becomes NaN.

    Raises:
        FieldError: what came is something else.
    """
    if reading is None:
        return None
    place, clutch = pair(f"reading of {arm}", reading)
    read = Vectors()
    position = read.vector(f"position of {arm}", place, 3)
    if read.error is not None:
        raise read.error
    return position, flag(f"clutch of {arm}", clutch)


def _hand(read: Vectors, field: str, value: object) -> HandSample | None:
    """What is commanded of a hand; None for nothing."""
    if value is None:
        return None
    hand = of_kind(field, value, HandSample)
    return HandSample(
        position=read.vector(f"position of {field}", hand.position, 3),
        clutch=flag(f"clutch of {field}", hand.clutch),
        orientation=read.maybe(f"orientation of {field}", hand.orientation, 4),
        velocity=read.maybe(f"velocity of {field}", hand.velocity, 3),
    )


class DeviceStatus(Enum):
    """What became of the last sample."""

    OK = "ok"
    STALE = "no new sample for a moment: the last one holds"
    REFUSED = "the last sample was refused: the one before holds"
    LOST = "the device stopped sending: the feet go back to the ground"
    WAITING = "bring each device down to its foot to take hold of it"
    WALKING = "the robot walks as it is told; when it stands, take hold of each foot anew"
    OVERRULED = "the robot steps by itself so as not to fall; then take hold of each foot anew"
