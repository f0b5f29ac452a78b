"""`TurnRate`: how fast something is turned to where it shall be.

`serve`: joint velocities that do more of one thing and change nothing of another. `stopping`:
velocities from which joints still stop at their limits.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.dynamics import rotation_vector

_BRAKING = 0.6
"""Part of the largest acceleration that is counted on near the goal."""

_KEPT = 1e-6
"""Damping of what comes first [m^2]: rows that are nearly the same can both be kept."""

_LEAST_SPEED, _LOST = 0.1, 0.5
"""What is to turn faster than this [rad/s], and loses more than this part of what it is to gain in
a tick, is turned as far as it goes."""


@dataclass(frozen=True, kw_only=True)
class TurnRate:
    """Angular velocities towards a goal.

    Attributes:
        gain: speed over angle [1/s].
        speed: largest [rad/s].
        acceleration: largest [rad/s^2].
        dt: length of a tick [s].
    """

    gain: float
    speed: float
    acceleration: float
    dt: float

    def towards(
        self, goal: Float64[np.ndarray, "3 3"], actual: Float64[np.ndarray, "3 3"]
    ) -> Float64[np.ndarray, "3"]:
        """The angular velocity that is to be: no faster than it can be braked [rad/s].

        Args:
            goal: how it shall be turned.
            actual: how it is.
        """
        way = rotation_vector(goal, actual)
        far = math.hypot(*way)
        braked = math.sqrt(2.0 * _BRAKING * self.acceleration * far)
        return way * (min(self.gain * far, braked, self.speed) / max(far, 1e-9))

    def change(
        self, wanted: Float64[np.ndarray, "3"], before: Float64[np.ndarray, "3"]
    ) -> Float64[np.ndarray, "3"]:
        """The angular velocity of this tick [rad/s].

        Args:
            wanted: what is to be in the end [rad/s].
            before: what is [rad/s].
        """
        change = wanted - before
        most = self.acceleration * self.dt
        return before + change * min(1.0, most / max(math.hypot(*change), 1e-12))


def is_stuck(
    wanted: Float64[np.ndarray, "3"],
    asked: Float64[np.ndarray, "3"],
    found: Float64[np.ndarray, "3"],
) -> bool:
    """Whether something is turned as far as it goes.

    Args:
        wanted: angular velocity that is to be in the end [rad/s].
        asked: in this tick [rad/s].
        found: what the joints do of that [rad/s].
    """
    speed = math.hypot(*wanted)
    along = float(wanted @ asked)
    return speed > _LEAST_SPEED and along > 0.0 and float(wanted @ found) < (1.0 - _LOST) * along


def serve(
    first: Float64[np.ndarray, "m k"],
    jacobian: Float64[np.ndarray, "r k"],
    reference: Float64[np.ndarray, " r"],
    velocity: Float64[np.ndarray, " k"],
    bounds: tuple[Float64[np.ndarray, " k"], Float64[np.ndarray, " k"]],
    near: tuple[Float64[np.ndarray, "p k"], Float64[np.ndarray, " p"]],
    damping: float,
) -> Float64[np.ndarray, " k"]:
    """Joint velocities that do what is asked for and change nothing of what comes first.

    To the velocities x is added d with A d = 0, by damped least squares in the null space N of A,

        d = N B^T (B N B^T + l^2 1)^-1 (w - B x)

    as far as bounds and near pairs allow it. What has come to its end by then is kept, too, and the
    rest does what it can for what is left (saturation in the null space, Flacco and others 2012).

    Args:
        first: A, rows that are kept.
        jacobian: B.
        reference: w, what B x shall be [m/s, rad/s].
        velocity: x, within what follows [rad/s].
        bounds: least and largest velocities [rad/s].
        near: rows, and the least that their products with the velocities may be [m/s].
        damping: l [m, 1].

    Returns:
        x + d [rad/s].
    """
    found, (low, high), (rows, least) = velocity.copy(), bounds, near
    free, held = np.ones(len(found), dtype=np.bool_), np.zeros(len(least), dtype=np.bool_)
    for _ in range(len(found)):
        kept = np.vstack((first, rows[held]))[:, free]
        B = jacobian[:, free]
        inverse = np.linalg.inv(kept @ kept.T + _KEPT * np.eye(len(kept)))
        within = B - (B @ kept.T) @ inverse @ kept
        squares = within @ within.T + damping**2 * np.eye(len(jacobian))
        change = np.zeros(len(found))
        change[free] = within.T @ np.linalg.solve(squares, reference - jacobian @ found)
        joints = _parts(change, np.where(change > 0.0, high - found, found - low))
        pairs = _parts(rows @ change, rows @ found - least, only_down=True)
        pairs[held] = np.inf
        part = min(1.0, float(joints.min()), float(pairs.min(initial=np.inf)))
        found += part * change
        if part == 1.0:
            break
        free &= joints > part
        held |= pairs <= part
        if not free.any():
            break
    return found


def _parts(
    changes: Float64[np.ndarray, " n"], rooms: Float64[np.ndarray, " n"], *, only_down: bool = False
) -> Float64[np.ndarray, " n"]:
    """Which part of each change there is room for; no bound where nothing changes."""
    moves = changes < -_STILL if only_down else np.abs(changes) > _STILL
    return np.where(moves, np.maximum(rooms, 0.0) / np.where(moves, np.abs(changes), 1.0), np.inf)


_STILL = 1e-12
"""A velocity that is none [rad/s, m/s]."""


def stopping(room: Float64[np.ndarray, " k"], stop: float, dt: float) -> Float64[np.ndarray, " k"]:
    """The velocities that come to rest in so much room, which may be rounded below zero [rad/s].

    Args:
        room: up to a limit [rad].
        stop: acceleration that they stop with [rad/s^2].
        dt: length of a tick [s].
    """
    room = np.maximum(room, 0.0)
    return np.minimum(np.sqrt(2.0 * stop * room), 0.5 * room / dt)
