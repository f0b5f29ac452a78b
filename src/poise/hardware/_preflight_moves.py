"""Motions by hand before a run, and what they show of encoders, order, signs and axes."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import few
from poise.hardware._link import Joints
from poise.hardware._preflight_checks import PreflightCheck, Samples, limbs, of_joints
from poise.robots import Robot

MOVED = 0.15
"""Smallest motion that counts [rad]: nine degrees, which a person sees, and which a joint can make
that rests in the middle of a range of 0.5 rad, the smallest of G1, with a good margin."""

WINDOW = 0.1
"""Time over which changes are compared with integrated rates [s]."""

FLOOR = 0.01
"""Smallest change in a window that counts [rad]: seven times the noise of the difference of two
attitudes with 1 mrad each, and the rates' noise averages out."""

HALF = 0.5
"""Largest difference between a change and its integrated rate, by the larger of the two. A wrong
unit or gear differs by a factor of two or more, a wrong sign by two, another axis by more than one;
a delay of 10 ms differs by less than a third at 5 Hz, which no hand exceeds."""


class Move(NamedTuple):
    """Request for a motion by hand.

    Attributes:
        prompt: the request, as a sentence.
        joints: indices of the joints that have to move; none for the base.
        still: indices of those that have to move less.
        sign: of the motion of a single joint, which has to be the first to move; zero for several.
    """

    prompt: str
    joints: tuple[int, ...] = ()
    still: tuple[int, ...] = ()
    sign: int = 0

    def done(self, robot: Robot, samples: Samples) -> bool:
        """Return whether enough has moved."""
        if self.sign:
            return bool(np.any(_farthest(samples) >= MOVED))
        if self.joints:
            return bool(np.all(np.ptp(samples.q[:, list(self.joints)], axis=0) >= MOVED))
        return not self.lacking(robot, samples)

    def lacking(self, robot: Robot, samples: Samples) -> list[str]:
        """Return what has not moved as requested, in words."""
        names, reach = robot.joint_names, np.ptp(samples.q, axis=0)
        if self.sign:
            return self._single(robot, samples)
        if not self.joints:
            turned = np.append(np.ptp(samples.up[:, :2], axis=0)[::-1], np.ptp(_heading(samples)))
            return [f"base about {a}" for a, t in zip("xyz", turned, strict=True) if t < MOVED]
        lacking = [f"{names[k]} stays" for k in self.joints if reach[k] < MOVED]
        # The other limbs swing with the pelvis, less than the one that is moved.
        most = reach[list(self.joints)].max()
        return lacking + [f"{names[k]} moves more" for k in self.still if reach[k] >= most]

    def _single(self, robot: Robot, samples: Samples) -> list[str]:
        far, joint = _farthest(samples), self.joints[0]
        moved = np.flatnonzero(np.any(far >= MOVED, axis=1))
        if not len(moved):
            return [f"{robot.joint_names[joint]} stays"]
        first = int(np.argmax(far[moved[0]]))
        if first != joint:
            return [f"{robot.joint_names[first]} moves in place of {robot.joint_names[joint]}"]
        forward = samples.q[moved[0], joint] > samples.q[0, joint]
        return [] if forward == (self.sign > 0) else [f"{robot.joint_names[joint]} moves backwards"]


ROCK = Move("Tilt the pelvis slowly by 15 degrees to each side, forward and back, and turn it.")
"""For the inertial unit."""


def limb_moves(robot: Robot) -> tuple[Move, ...]:
    """Return one move for each limb, of all its joints in any way."""
    parts = limbs(robot)
    return tuple(
        Move(
            f"Move all {len(joints)} joints of the limb with {end}, and no other limb.",
            joints,
            tuple(k for other, others in parts.items() if other != end for k in others),
        )
        for end, joints in parts.items()
    )


def joint_move(robot: Robot, joint: int, q: Joints) -> Move:
    """Return the move of one joint from a posture, away from its nearer limit, in words."""
    data, sign = robot.model.createData(), 1
    at = np.append(robot.q_home[: robot.nq - robot.nj], q)
    pin.centerOfMass(robot.model, data, at, True)
    if robot.q_max[joint] - q[joint] < q[joint] - robot.q_min[joint]:
        sign = -1
    index = next(k for k, j in enumerate(robot.model.joints) if j.idx_v == robot.base_dofs + joint)
    rotation = data.oMi[index].rotation
    axis = pin.computeJointJacobian(robot.model, data, at, index)[3:, robot.base_dofs + joint]
    way = _way(sign * rotation @ axis, rotation @ data.com[index])
    name = robot.joint_names[joint]
    text = f"Hold the link above {name} and move the one below by it: {way}."
    return Move(text, (joint,), (), sign)


def motion_checks(
    robot: Robot, moves: Sequence[Move], records: Sequence[Samples]
) -> list[PreflightCheck]:
    """Check what has been measured during the moves, of which the first is `ROCK`.

    Args:
        robot: the model.
        moves: the requests.
        records: measurements of each.
    """
    pairs = [_changes(record) for record in records]
    rates, changes = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    wrong = _differ(rates, changes)
    lacking = [
        text
        for move, record in zip(moves, records, strict=True)
        for text in move.lacking(robot, record)
    ]
    gyro, accelerometer = (
        _axes(rates[:, -3:], changes[:, -3:]),
        _axes(records[0].acceleration, records[0].up),
    )
    return [
        PreflightCheck(
            name="moves",
            seen=few(lacking, 2) or f"{len(moves)} as requested",
            wanted=f"{MOVED:g} rad of what was requested",
            remedy="repeat the motion; if it was right, correct order, sign or encoder",
            ok=not lacking,
        ),
        of_joints(
            robot,
            wrong[:-3],
            name="encoders",
            good="velocities are the positions' rates",
            bad="velocity is no rate of the position",
            wanted=f"equal within {HALF:.0%}",
            remedy="check order, sign and unit of velocities; look for encoders that stand",
        ),
        of_joints(
            robot,
            _driven(
                np.concatenate([r.tau for r in records]), np.concatenate([r.dq for r in records])
            ),
            name="torque signs",
            good="no torque drives a motion",
            bad="torque along the motion",
            wanted="torques that damp",
            remedy="check order and sign of these torques",
        ),
        PreflightCheck(
            name="gyro",
            seen=f"best as {gyro}" + ("" if not wrong[-3:].any() else ", no rate of the attitude"),
            wanted=f"x, y, z of the base, equal within {HALF:.0%}",
            remedy="turn the gyro by the mounting of the inertial unit; check units and signs",
            ok=gyro == "x, y, z" and not wrong[-3:].any(),
        ),
        PreflightCheck(
            name="accelerometer axes",
            seen=f"best as {accelerometer}",
            wanted="x, y, z of the base",
            remedy="turn the accelerometer by the mounting of the inertial unit; check signs",
            ok=accelerometer == "x, y, z",
        ),
    ]


def _farthest(samples: Samples) -> Float64[np.ndarray, "n nj"]:
    return np.abs(samples.q - samples.q[0])


def _turns(
    quaternion: Float64[np.ndarray, "n 4"], later: Float64[np.ndarray, "n 4"]
) -> Float64[np.ndarray, "n 3"]:
    """Return the rotation vectors from the one to the other, in the former's axes; small ones."""
    (a, aw), (b, bw) = ((q[:, :3], q[:, 3:]) for q in (quaternion, later))
    scalar = aw * bw + np.sum(a * b, axis=1, keepdims=True)
    return 2.0 * np.sign(scalar) * (aw * b - bw * a - np.cross(a, b))


def _heading(samples: Samples) -> Float64[np.ndarray, " n"]:
    x, y, z, w = samples.quaternion.T
    return np.unwrap(np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)))


def _changes(
    samples: Samples,
) -> tuple[Float64[np.ndarray, "windows n"], Float64[np.ndarray, "windows n"]]:
    """Return integrated rates and changes of all joints and of the base, window by window."""
    periods = np.diff(samples.time)
    count = max(1, round(WINDOW / max(float(np.median(periods)), 1e-9)))
    ends = np.arange(0, len(samples.time), count)
    rates = np.hstack([samples.dq, samples.gyro])
    integral = np.zeros_like(rates)
    integral[1:] = np.cumsum(0.5 * (rates[1:] + rates[:-1]) * periods[:, None], axis=0)
    turns = _turns(samples.quaternion[ends[:-1]], samples.quaternion[ends[1:]])
    return np.diff(integral[ends], axis=0), np.hstack([np.diff(samples.q[ends], axis=0), turns])


def _differ(rates: Float64[np.ndarray, "w n"], changes: Float64[np.ndarray, "w n"]) -> np.ndarray:
    """Return which columns differ, in windows in which either is large enough."""
    large = np.maximum(np.abs(rates), np.abs(changes)) >= FLOOR
    error, one, other = (
        np.sum(np.where(large, x, 0.0) ** 2, axis=0) for x in (rates - changes, rates, changes)
    )
    return error > HALF**2 * np.maximum(one, other)


def _driven(tau: Float64[np.ndarray, "n nj"], dq: Float64[np.ndarray, "n nj"]) -> np.ndarray:
    """Return the joints whose torques are along their velocities: cosine above one half."""
    tau = np.nan_to_num(tau)
    return np.sum(tau * dq, axis=0) > HALF * np.sqrt(np.sum(tau**2, axis=0) * np.sum(dq**2, axis=0))


def _axes(measured: Float64[np.ndarray, "n 3"], true: Float64[np.ndarray, "n 3"]) -> str:
    """Return the signed permutation of the true axes that is nearest to the measured ones."""
    products = measured.T @ true
    best = max(
        itertools.product(itertools.permutations(range(3)), itertools.product((1, -1), repeat=3)),
        key=lambda axes: sum(s * products[k, axes[0][k]] for k, s in enumerate(axes[1])),
    )
    return ", ".join(("" if s > 0 else "-") + "xyz"[k] for k, s in zip(*best, strict=True))


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
