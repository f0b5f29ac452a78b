"""Motions by hand before a run, and what they show of encoders, order, signs and axes."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Bool, Float64

from poise._show import few
from poise.hardware._link import Joints
from poise.hardware._preflight_checks import (
    PreflightCheck,
    Samples,
    attitudes,
    limbs,
    of_joints,
    vertical,
)
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


Windows = Float64[np.ndarray, "rows n"]
_RIGHT = "x, y, z"


class Move(NamedTuple):
    """Request for a motion by hand.

    Attributes:
        prompt: the request, as a sentence.
        joints: indices of the joints that have to move; none for the base.
        still: indices of those that have to move less.
        sign: of the motion of a single joint; zero for several.
    """

    prompt: str
    joints: tuple[int, ...] = ()
    still: tuple[int, ...] = ()
    sign: int = 0

    def reach(self, samples: Samples) -> Float64[np.ndarray, " n"]:
        """Return the ranges of the joints, or of the base's turn about its axes."""
        if self.joints:
            return np.ptp(samples["q"][:, list(self.joints)], axis=0)
        return np.ptp(_turns(samples, from_first=True), axis=0)

    def lacking(self, robot: Robot, samples: Samples) -> list[str]:
        """Return what has not moved as requested, in words."""
        names, q, reach = robot.joint_names, samples["q"], self.reach(samples)
        moved = [names[k] for k in self.joints] or [f"base about {axis}" for axis in "xyz"]
        lacking = [f"{name} stays" for name, r in zip(moved, reach, strict=True) if r < MOVED]
        # The others swing with what is moved, but less.
        farther = np.ptp(q, axis=0) >= reach.max()
        lacking += [f"{names[k]} moves more" for k in self.still if farther[k]]
        if self.sign:
            away = q[:, self.joints[0]] - q[0, self.joints[0]]
            if away[np.argmax(np.abs(away) >= MOVED)] * self.sign < 0.0:
                lacking.append(f"{moved[0]} moves backwards")
        return lacking


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
    return Move(text, (joint,), tuple(k for k in range(robot.nj) if k != joint), sign)


def motion_checks(
    robot: Robot, moves: Sequence[Move], records: Sequence[Samples]
) -> list[PreflightCheck]:
    """Check what has been measured during each of the moves, of which the first is `ROCK`."""
    pairs = [_changes(record) for record in records]
    rates, changes = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    wrong, whole = _differ(rates, changes), np.concatenate(records)
    lacking = [
        text for move, s in zip(moves, records, strict=True) for text in move.lacking(robot, s)
    ]
    gyro = _axes(rates[:, -3:], changes[:, -3:])
    accelerometer = _axes(records[0]["acceleration"], vertical(records[0]))
    seen, wanted = few(lacking, 2) or f"{len(moves)} as requested", f"{MOVED:g} rad as requested"
    remedy = "repeat the motion; if it was right, correct order, sign or encoder"
    checks = [PreflightCheck("moves", seen, wanted, remedy, not lacking)]
    wanted, bad = f"equal within {HALF:.0%}", "velocity is no rate of the position"
    remedy = "check order, sign and unit of velocities; look for encoders that stand"
    checks.append(of_joints(robot, "encoders", wrong[:-3], bad, wanted, remedy))
    driven, bad = _driven(whole["tau"], whole["dq"]), "torque along the motion"
    remedy = "check order and sign of these torques"
    checks.append(of_joints(robot, "torque signs", driven, bad, "torques that damp", remedy))
    seen = f"best as {gyro}" + (", no rate of the attitude" if wrong[-3:].any() else "")
    good, remedy = gyro == _RIGHT and not wrong[-3:].any(), "turn it by its mounting; check units"
    checks.append(PreflightCheck("gyro", seen, f"{_RIGHT}, {wanted}", remedy, good))
    seen, good = f"best as {accelerometer}", accelerometer == _RIGHT
    return [*checks, PreflightCheck("accelerometer axes", seen, _RIGHT, remedy, good)]


def _ends(samples: Samples) -> slice:
    """Return the ends of windows."""
    period = max(float(np.median(np.diff(samples["time"]))), 1e-9)
    return slice(None, None, max(1, round(WINDOW / period)))


def _turns(samples: Samples, *, from_first: bool = False) -> Float64[np.ndarray, "windows 3"]:
    """Return the rotation vectors of the windows, or from the first attitude to their ends."""
    frames = [pin.Quaternion(q).matrix() for q in attitudes(samples)[_ends(samples)]]
    before = [frames[0]] * (len(frames) - 1) if from_first else frames[:-1]
    turns = [pin.log3(a.T @ b) for a, b in zip(before, frames[1:], strict=True)]
    return np.array([np.zeros(3), *turns])[not from_first :]


def _changes(samples: Samples) -> tuple[Windows, Windows]:
    """Return integrated rates and changes of all joints and of the base, window by window."""
    periods, ends = np.diff(samples["time"])[:, None], _ends(samples)
    rates = np.hstack([samples["dq"], samples["gyro"]])
    steps = 0.5 * (rates[1:] + rates[:-1]) * periods
    integral = np.vstack([np.zeros_like(rates[:1]), np.cumsum(steps, axis=0)])
    changes = np.hstack([np.diff(samples["q"][ends], axis=0), _turns(samples)])
    return np.diff(integral[ends], axis=0), changes


def _differ(rates: Windows, changes: Windows) -> Bool[np.ndarray, " n"]:
    """Return which columns differ, in windows in which either is large enough."""
    large = np.maximum(np.abs(rates), np.abs(changes)) >= FLOOR
    error, one, other = (
        np.sum(np.where(large, x, 0.0) ** 2, axis=0) for x in (rates - changes, rates, changes)
    )
    return error > HALF**2 * np.maximum(one, other)


def _driven(tau: Windows, dq: Windows) -> Bool[np.ndarray, " n"]:
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
