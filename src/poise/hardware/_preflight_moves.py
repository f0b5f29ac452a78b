"""Motions by hand before a run, and what they show of encoders, order, signs and axes."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Bool, Float64

from poise._show import few
from poise.hardware import _preflight_checks as at_rest
from poise.hardware._link import Joints
from poise.hardware._preflight_checks import PreflightCheck, Samples, none_of
from poise.robots import Robot

MOVED = 0.15  # [rad]: nine degrees, seen by eye, within half of G1's smallest range of 0.5 rad
WINDOW = 0.1  # over which changes are compared with integrated rates [s]
_FLOOR = 0.01  # smallest change in a window [rad]: seven times two attitudes' noise of 1 mrad
# Largest difference of a change and its integrated rate, by the larger of the two: a wrong unit or
# gear differs by a factor of two or more, a sign by two, another axis by more than one, and a delay
# of 10 ms by less than a third at 5 Hz, which no hand exceeds.
_HALF = 0.5

Rows = Float64[np.ndarray, "rows n"]


class Move(NamedTuple):
    """Request for a motion by hand.

    Attributes:
        prompt: the request, as a sentence.
        joints: indices of the joints that have to move, one of them farther than any other; none
            for the base.
        sign: of the motion of a single joint; zero for several.
    """

    prompt: str
    joints: tuple[int, ...] = ()
    sign: int = 0

    def reach(self, samples: Samples) -> Float64[np.ndarray, " n"]:
        """Return the ranges of the joints, or of the base's turn about its axes."""
        if self.joints:
            return np.ptp(samples["q"][:, list(self.joints)], axis=0)
        frames = at_rest.attitudes(samples)
        return np.ptp([pin.log3(frames[0].T @ frame) for frame in frames], axis=0)

    def lacking(self, robot: Robot, samples: Samples) -> list[str]:
        """Return what has not moved as requested, in words."""
        q, reach = samples["q"], self.reach(samples)
        moved = [robot.joint_names[k] for k in self.joints] or [f"base about {x}" for x in "xyz"]
        lacking = [f"{name} stays" for name, r in zip(moved, reach, strict=True) if r < MOVED]
        farthest = int(np.argmax(np.ptp(q, axis=0)))
        if self.joints and farthest not in self.joints:
            lacking.append(f"{robot.joint_names[farthest]} moves more")
        if self.sign:
            away = q[:, self.joints[0]] - q[0, self.joints[0]]
            if away[np.argmax(np.abs(away) >= MOVED)] * self.sign < 0.0:
                lacking.append(f"{moved[0]} moves backwards")
        return lacking


ROCK = Move("Tilt the pelvis slowly by 15 degrees to each side, forward and back, and turn it.")
"""For the inertial unit."""


def limb_moves(robot: Robot) -> Iterator[Move]:
    """Yield one move for each limb, of all its joints in any way."""
    for end, joints in at_rest.limbs(robot).items():
        text = f"Move all {len(joints)} joints of the limb with {end}, and no other limb."
        yield Move(text, joints)


def joint_move(robot: Robot, joint: int, q: Joints) -> Move:
    """Return the move of one joint from a posture, away from its nearer limit, in words."""
    model, data = robot.model, robot.model.createData()
    at, column = np.append(robot.q_home[: robot.nq - robot.nj], q), robot.base_dofs + joint
    pin.centerOfMass(model, data, at, True)
    sign = 1 if robot.q_max[joint] - q[joint] >= q[joint] - robot.q_min[joint] else -1
    index = next(k for k, j in enumerate(model.joints) if j.idx_v == column)
    rotation = data.oMi[index].rotation
    axis = sign * rotation @ pin.computeJointJacobian(model, data, at, index)[3:, column]
    name, way = robot.joint_names[joint], _way(axis, rotation @ data.com[index])
    text = f"Hold the link above {name} and move the one below by it: {way}."
    return Move(text, (joint,), sign)


def motion_checks(
    robot: Robot, moves: Sequence[Move], records: Sequence[Samples]
) -> list[PreflightCheck]:
    """Check what has been measured during each of the moves, of which the first is `ROCK`."""
    names, rock, whole = robot.joint_names, records[0], np.concatenate(records)
    wrong = _differ(*map(np.concatenate, zip(*map(_changes, records), strict=True)))
    texts = [move.lacking(robot, record) for move, record in zip(moves, records, strict=True)]
    lacking = [text for some in texts for text in some]
    seen, wanted = few(lacking, 2) or f"{len(moves)} as requested", f"{MOVED:g} rad as requested"
    repeat = "repeat the motion; if it was right, correct order, sign or encoder"
    driven = _cosines(np.nan_to_num(whole["tau"]), whole["dq"]) > _HALF
    askew = _cosines(rock["acceleration"], at_rest.attitudes(rock)[:, 2]) < _HALF
    equal, unlike = f"equal within {_HALF:.0%}", "velocity is no rate of the position"
    units = "check order, sign and unit of velocities; look for encoders that stand"
    order, turn = "check order and sign", "turn it by its mounting; check signs"
    return [
        PreflightCheck("moves", seen, wanted, repeat, not lacking),
        none_of("encoders", names, wrong[:-3], unlike, equal, units),
        none_of("torque signs", names, driven, "along the motion", "torques that damp", order),
        none_of("gyro", "xyz", wrong[-3:], "no rate of the attitude", equal, turn),
        none_of("accelerometer axes", "xyz", askew, "not vertical", "the attitude's", turn),
    ]


def _changes(samples: Samples) -> tuple[Rows, Rows]:
    """Return integrated rates and changes of all joints and of the base, window by window."""
    periods = np.diff(samples["time"])[:, None]
    ends = slice(None, None, max(1, round(WINDOW / max(float(np.median(periods)), 1e-9))))
    rates = np.hstack([samples["dq"], samples["gyro"]])
    steps = 0.5 * (rates[1:] + rates[:-1]) * periods
    integral = np.vstack([np.zeros_like(rates[:1]), np.cumsum(steps, axis=0)])
    frames = at_rest.attitudes(samples[ends])
    turns = [pin.log3(one.T @ other) for one, other in pairwise(frames)]
    changes = np.hstack([np.diff(samples["q"][ends], axis=0), np.reshape(turns, (-1, 3))])
    return np.diff(integral[ends], axis=0), changes


def _differ(rates: Rows, changes: Rows) -> Bool[np.ndarray, " n"]:
    """Return which columns differ, in windows in which either is large enough."""
    large = np.maximum(np.abs(rates), np.abs(changes)) >= _FLOOR
    error, one, other = (
        np.sum(np.where(large, x, 0.0) ** 2, axis=0) for x in (rates - changes, rates, changes)
    )
    return error > _HALF**2 * np.maximum(one, other)


def _cosines(one: Rows, other: Rows) -> Float64[np.ndarray, " n"]:
    """Return the cosines between columns; zero where one is zero."""
    product = np.linalg.norm(one, axis=0) * np.linalg.norm(other, axis=0)
    return np.sum(one * other, axis=0) / np.maximum(product, 1e-12)


def _way(axis: Float64[np.ndarray, "3"], arm: Float64[np.ndarray, "3"]) -> str:
    """Return a direction in words, for one who stands as the robot does."""
    path, length = np.cross(axis, arm), np.linalg.norm(arm)
    # Nearer to the axis than 30 degrees a link is seen to turn, not to go somewhere.
    if np.linalg.norm(path) < 0.5 * length:
        k = int(np.argmax(np.abs(axis)))
        seen = (("front", "back"), ("left", "right"), ("above", "below"))[k][int(axis[k] < 0.0)]
        return f"turn it counterclockwise, seen from {seen}"
    k = int(np.argmax(np.abs(path)))
    ways = ("forward", "backward"), ("to the left", "to the right"), ("up", "down")
    return f"its far end goes {ways[k][int(path[k] < 0.0)]}"
