"""What the arms of a robot that nobody has described need: hands, and elbows that are bent."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.robots._geometry import link_shapes
from poise.robots._limbs import Arms, Chain
from poise.robots._proposed_feet import body_frames
from poise.robots._robot import ModelSource

_FOREARM = 0.25
"""What the last joint of an arm moves is a forearm where it reaches this far, else a hand [m]."""

_BEND = 0.8
"""Angle by which an elbow is bent [rad]."""

_STRAIGHT = 0.3
"""An elbow that is bent by less, or cannot be bent by more, is straight [rad]."""

_MARGIN = 0.02
"""Distance kept from position limits [rad]."""

_BACK = 0.05
"""No hand is bent to further behind its shoulder than this part of the arm's length."""

_UPPER_ARM = 0.1
"""An elbow is so far from the joints of its shoulder, by the arm's length."""


@dataclass(frozen=True)
class Hand:
    """Where a hand is.

    Attributes:
        joint: that carries it.
        point: in the axes of that joint [m].
        reason: for the point.
    """

    joint: int
    point: Float64[np.ndarray, "3"]
    reason: str


def find_hand(model: pin.Model, source: ModelSource, joint: int, where: str) -> Hand:
    """Where a hand is.

    Args:
        model: of the robot.
        source: of its shapes.
        joint: the last one of its arm.
        where: it comes from, for messages.
    """
    com = np.array(model.inertias[joint].lever)
    frames = body_frames(model, joint)
    names = [model.frames[i].name for i in frames]
    shapes = link_shapes(source, names, where)
    parts = [
        balls.moved(model.frames[i].placement).centres
        for i, name in zip(frames, names, strict=True)
        for balls in (*shapes[name].visual, *shapes[name].collision)
    ]
    size = float(np.linalg.norm(com))
    if parts and size > 1e-3:
        along = com / size
        end = float(max((points @ along).max() for points in parts))
        if end > _FOREARM:
            reason = "near the end of a forearm without a hand of its own"
            return Hand(joint, 0.9 * end * along, reason)
    return Hand(joint, com, "end of the arm, at the COM of what its last joint moves")


def bend_arms(
    model: pin.Model, q: Float64[np.ndarray, " nq"], arms: Arms, hands: Sequence[Hand]
) -> dict[str, float]:
    """Joint positions that bend straight arms, whose hands could not move along them.

    Of each arm its elbow is turned: the joint that is far from the shoulder and moves the hand far;
    on the right so that it mirrors the left. Arms that are bent already stay.

    Args:
        model: the model with a free base as its first joint.
        q: the configuration that arms are in.
        arms: left and right, or one.
        hands: at their ends.

    Returns:
        Positions by joint [rad].
    """
    bent: dict[str, float] = {}
    wanted = None
    for chain, hand in zip(arms.chains, hands, strict=True):
        arm = _Arm(model, chain, hand, arms.forward)
        turns = arm.turns(q)
        if wanted is not None:
            turns.sort(key=lambda turn: float(np.linalg.norm(turn.moved - wanted)))
        else:
            turns.sort(key=lambda turn: (turn.back, -round(turn.middle, 2), -turn.ahead))
        if not turns or arm.bent(q, turns[0].joint) > _STRAIGHT:
            return bent
        best = turns[0]
        bent[model.names[best.joint]] = best.angle
        across = np.cross([0.0, 0.0, 1.0], arms.forward)
        wanted = best.moved - 2.0 * float(best.moved @ across) * across
    return bent


@dataclass(frozen=True)
class _Turn:
    """One joint of an arm turned.

    Attributes:
        joint: which.
        angle: to which [rad].
        moved: by how much the hand is [m].
        middle: the shorter of its distance from the shoulder and its lever on the hand, by the
            arm's length.
        back: whether that brings it behind the shoulder.
        ahead: how far it is forward and up [m].
    """

    joint: int
    angle: float
    moved: Float64[np.ndarray, "3"]
    middle: float
    back: bool
    ahead: float


class _Arm:
    """An arm in any posture."""

    def __init__(
        self, model: pin.Model, chain: Chain, hand: Hand, forward: Float64[np.ndarray, "3"]
    ) -> None:
        self._model, self._data = model, model.createData()
        self._chain, self._hand, self._forward = chain, hand, forward
        offsets = [np.array(model.jointPlacements[j].translation) for j in chain[1:]]
        self._length = max(float(sum(np.linalg.norm(o) for o in [*offsets, hand.point])), 1e-9)

    def bent(self, q: Float64[np.ndarray, " nq"], joint: int) -> float:
        """The angle between what is before a joint and what is behind it [rad]."""
        hand = self._place(q)
        elbow = self._origin(joint)
        for other in reversed(self._chain[: self._chain.index(joint)]):
            upper, lower = elbow - self._origin(other), hand - elbow
            size = float(np.linalg.norm(upper))
            if size > _UPPER_ARM * self._length:
                cosine = float(upper @ lower) / (size * max(float(np.linalg.norm(lower)), 1e-9))
                return math.acos(min(max(cosine, -1.0), 1.0))
        return math.pi

    def turns(self, q: Float64[np.ndarray, " nq"]) -> list[_Turn]:
        """What turning each joint by itself does."""
        model, found = self._model, list[_Turn]()
        before, shoulder = self._place(q), self._origin(self._chain[0])
        for joint in self._chain:
            k = model.joints[joint].idx_q
            low = float(model.lowerPositionLimit[k]) + _MARGIN
            high = float(model.upperPositionLimit[k]) - _MARGIN
            for bend in (_BEND, -_BEND):
                angle = round(min(max(float(q[k]) + bend, low), high), 2)
                by = (angle - float(q[k])) * math.copysign(1.0, bend)
                if by < _STRAIGHT:
                    continue
                turned = q.copy()
                turned[k] = angle
                place = self._place(turned)
                moved = place - before
                ahead, behind = (float(v @ self._forward) for v in (moved, place - shoulder))
                upper = float(np.linalg.norm(self._origin(joint) - shoulder))
                found.append(
                    _Turn(
                        joint=joint,
                        angle=angle,
                        moved=moved,
                        middle=min(upper, float(np.linalg.norm(moved)) / by) / self._length,
                        back=ahead < 0.0 and behind < -_BACK * self._length,
                        ahead=ahead + float(moved[2]),
                    )
                )
        return found

    def _origin(self, joint: int) -> Float64[np.ndarray, "3"]:
        return np.array(self._data.oMi[joint].translation)

    def _place(self, q: Float64[np.ndarray, " nq"]) -> Float64[np.ndarray, "3"]:
        pin.forwardKinematics(self._model, self._data, q)
        return np.array(self._data.oMi[self._hand.joint].act(self._hand.point))
