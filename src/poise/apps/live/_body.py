"""`BodyLimits`: how far height, torso and feet of a robot go.

`Bend`: where a gamepad sends them. `bent`: what is asked of them a moment later.
"""

import math
from typing import NamedTuple

from poise.locomotion import FOOT_TURNS, TORSO_MOST, BodyCommand, StepTeleoperator

_RISE = 0.04
"""How much higher legs lift the COM that straighten, over its height."""

_RAISED, _LEANT, _TURNED = 0.06, 0.4, 0.4
"""How fast height [m/s], torso and feet [rad/s] change while a button is held; the page's keys are
as fast."""


class BodyLimits(NamedTuple):
    """How far body and feet go that somebody leads; those of a robot that is driven do not.

    Attributes:
        height: of the COM, the lowest and the highest, over the usual one [m].
        torso: roll, pitch and yaw, to either side [rad].
        turns: of a foot, inwards and outwards against the other one [rad].
    """

    height: tuple[float, float] = (0.0, 0.0)
    torso: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turns: tuple[float, float] = (0.0, 0.0)


def limits_of(teleoperator: StepTeleoperator) -> BodyLimits:
    """Those of a robot whose feet are on the ground where it starts."""
    estimator = teleoperator.estimator
    left, right = estimator.anchors
    height = float(estimator.dynamics.com[2] - 0.5 * (left[2] + right[2]))
    reach = (-teleoperator.parameters.stoop_max * height, _RISE * height)
    if teleoperator.actuation == "velocity":
        return BodyLimits(reach)
    return BodyLimits(reach, TORSO_MOST, FOOT_TURNS)


class Bend(NamedTuple):
    """Where body and held feet are sent, each from -1 to 1.

    Attributes:
        height: up.
        pitch: the torso, forward.
        yaw: the torso, to the left.
        turn: the feet that are held, to the left.
        neutral: whether everything goes back to where nothing is asked.
    """

    height: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    turn: float = 0.0
    neutral: bool = False


def bent(
    body: BodyCommand,
    bend: Bend,
    held: tuple[bool, bool],
    seconds: float,
    limits: BodyLimits,
) -> BodyCommand:
    """What is asked of the body after a button was held for a moment; it stays when it is let go.

    Args:
        body: what was asked before.
        bend: where it is sent.
        held: whether the left and the right foot is held, which can be turned then.
        seconds: how long [s].
        limits: of the robot.
    """
    if bend.neutral:
        return BodyCommand()
    roll, pitch, yaw = body.torso
    _, most_pitch, most_yaw = limits.torso
    pitch += seconds * _LEANT * bend.pitch
    yaw += seconds * _LEANT * bend.yaw
    turns = body.turns
    if bend.turn:
        turn, (inwards, outwards) = seconds * _TURNED * bend.turn, limits.turns
        left, right = turns
        if held[0]:
            left = _turned(left + turn, right, -inwards, outwards)
        if held[1]:
            right = _turned(right + turn, left, -outwards, inwards)
        turns = left, right
    return BodyCommand(
        height=_clipped(body.height + seconds * _RAISED * bend.height, *limits.height),
        torso=(roll, _clipped(pitch, -most_pitch, most_pitch), _clipped(yaw, -most_yaw, most_yaw)),
        turns=turns,
    )


def _clipped(value: float, least: float, most: float) -> float:
    return max(least, min(most, value))


def _turned(turn: float, other: float, least: float, most: float) -> float:
    """A foot's angle within its range against the other one's, from -pi to pi [rad]."""
    against = _clipped(math.remainder(turn - other, math.tau), least, most)
    return math.remainder(other + against, math.tau)
