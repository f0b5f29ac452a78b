"""`Targets` and `BalanceState`: the messages of the balance service, as JSON."""

import math

import msgspec
from msgspec import Struct

from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import Vector, rotation_of
from poise.robots import Robot

_FARTHEST = 100.0
"""Largest number of a target [m, rad]: what is larger means no command, and may overflow."""


class HandTarget(Struct, frozen=True, forbid_unknown_fields=True):
    """Pose of a hand's frame in the frame of the torso, whose axes are forward, left and up.

    Attributes:
        position: [m].
        orientation: torso_R_hand, a unit quaternion (x, y, z, w); None for any.
    """

    position: Vector
    orientation: tuple[float, float, float, float] | None = None


class Targets(Struct, frozen=True, forbid_unknown_fields=True):
    """Message of a client: all that it commands at one time.

    Messages may be lost, the newest counts: each has all of the client's targets. A velocity counts
    after one of zero. A limb that no message has named for `HELD_FOR` eases back to rest.

    Attributes:
        time: on the sender's clock, later than that of the message before [s].
        velocity: ahead, to the left [m/s] and turning to the left [rad/s].
        joints: positions of joints of arms and neck, by name [rad]. Those of a limb that are left
            out keep their target.
        hands: poses of hands, by name, of arms none of whose joints are given.
    """

    time: float
    velocity: Vector = (0.0, 0.0, 0.0)
    joints: dict[str, float] = {}
    hands: dict[str, HandTarget] = {}


class BalanceState(Struct, frozen=True):
    """Message of the service.

    Attributes:
        time: of the robot [s].
        command: status of the controller, such as "ok".
        walk: status of the walk.
        fallen: the robot lies.
        lost: no message for `LOST_AFTER`; the robot stops.
        velocity: followed by the walk, as in `Targets` [m/s, rad/s].
        joints: measured positions of all joints, by name [rad].
        speeds: their velocities [rad/s].
        hands: measured positions of the hands in the frame of the torso, by name [m].
        nearest: two links near each other, and their distance; None where none is near [m].
        refused: number of messages that did not count.
        reason: fault of the last of them; "" while there was none.
        notice: part of the last velocity that was cut.
    """

    time: float
    command: str
    walk: str
    fallen: bool
    lost: bool
    velocity: Vector
    joints: dict[str, float]
    speeds: dict[str, float]
    hands: dict[str, Vector]
    nearest: tuple[str, str, float] | None
    refused: int
    reason: str
    notice: str


_DECODER = msgspec.json.Decoder(Targets)


def read_targets(message: bytes) -> Targets:
    """Decode a message, or raise ConfigurationError."""
    try:
        return _DECODER.decode(message)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ConfigurationError(f"no message of targets: {error}") from None


def check_targets(targets: Targets, limbs: dict[str, tuple[str, ...]], robot: Robot) -> None:
    """Raise PoiseError for numbers that mean no command, and for unknown names.

    Args:
        targets: the message.
        limbs: names of the joints of each limb, by its frame.
        robot: of which the limbs are.
    """
    joints = {joint: name for name, own in limbs.items() for joint in own}
    for joint in targets.joints:
        if joint not in joints:
            raise UnknownNameError("no such joint of arms and neck", got=joint, choices=joints)
    hands = [name for name in robot.hands if name in limbs]
    for name, hand in targets.hands.items():
        if name not in hands:
            raise UnknownNameError("no such hand", got=name, choices=hands)
        if hand.orientation is not None and rotation_of(hand.orientation) is None:
            wanted = "a unit quaternion (x, y, z, w)"
            raise ConfigurationError(f"orientation of {name}", got=hand.orientation, wanted=wanted)
        if any(joint in targets.joints for joint in limbs[name]):
            raise ConfigurationError(f"{name} has a pose and joints", wanted="one of them")
    numbers = [*targets.velocity, *targets.joints.values()]
    numbers += [x for hand in targets.hands.values() for x in hand.position]
    # Written so that NaN fails.
    if not (math.isfinite(targets.time) and all(abs(x) <= _FARTHEST for x in numbers)):
        wanted = f"finite numbers, of targets at most {_FARTHEST:g}"
        raise ConfigurationError("numbers of targets", got=(targets.time, *numbers), wanted=wanted)
