"""`serve`: joint velocities that do more of one thing and change nothing of another.

`ArmServer`: the same for an arm whose hand is moved and turned, in one call a tick each.
"""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, say_if_slow
from poise.locomotion._stepping._upper_body._saturation import Work, ask, copy_rows, go, make_work

Bounds = tuple[Float64[np.ndarray, " k"], Float64[np.ndarray, " k"]]
"""Least and largest velocities [rad/s]."""

Near = tuple[Float64[np.ndarray, "p k"], Float64[np.ndarray, " p"]]
"""Rows of pairs of links that are near, and the least of each times velocities [m/s]."""


def serve(
    first: Float64[np.ndarray, "m k"],
    jacobian: Float64[np.ndarray, "r k"],
    reference: Float64[np.ndarray, " r"],
    velocity: Float64[np.ndarray, " k"],
    bounds: Bounds,
    near: Near,
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
    found = velocity.copy()
    work = make_work(len(found), len(first), len(jacobian))
    held = np.empty(len(near[1]))
    # One layout, whatever comes: each is compiled by itself.
    A, B = np.ascontiguousarray(first), np.ascontiguousarray(jacobian)
    _serve_alone(A, B, reference, *bounds, *near, held, damping, found, work)
    return found


class ArmServer:
    """Joint velocities of one arm that move its hand first and turn it by what that leaves free.

    Args:
        joints: how many the arm has.
    """

    def __init__(self, joints: int) -> None:
        self._work = make_work(joints, 3, 3)
        # What is compiled is compiled now, not in the first tick.
        say_if_slow(_turn, "hands that are turned")
        none, bounds = np.zeros(joints), (np.zeros(joints), np.zeros(joints))
        near, J = (np.zeros((0, joints)), np.zeros(0)), np.zeros((6, joints))
        self.turn(J, np.zeros(6), none, bounds, near, (1.0, 1.0, 1.0))
        self.step(J, none, none, (1.0, 1.0, 1.0))

    def turn(
        self,
        jacobian: Float64[np.ndarray, "6 k"],
        reference: Float64[np.ndarray, "6"],
        velocity: Float64[np.ndarray, " k"],
        bounds: Bounds,
        near: Near,
        how: tuple[float, float, float],
    ) -> Float64[np.ndarray, " k"]:
        """Velocities that move the hand as asked for, then turn it, and keep what is near apart.

        Args:
            jacobian: of the hand, linear first.
            reference: of the hand, linear first [m/s, rad/s].
            velocity: of the joints, before that; within what follows [rad/s].
            bounds: least and largest velocities [rad/s].
            near: rows, and the least that their products with the velocities may be [m/s].
            how: damping of moving [m] and of turning, and how fast joints may be that turn the
                hand [rad/s].
        """
        found, held = velocity.copy(), np.empty(len(near[1]))
        _turn(jacobian, reference, *bounds, *near, held, how, found, self._work)
        return found

    def step(
        self,
        jacobian: Float64[np.ndarray, "6 k"],
        before: Float64[np.ndarray, " k"],
        wanted: Float64[np.ndarray, " k"],
        how: tuple[float, float, float],
    ) -> Float64[np.ndarray, " k"]:
        """Velocities as near to the wanted ones as they may change in a tick, the hand's first.

        Args:
            jacobian: of the hand, linear first.
            before: velocities of the joints [rad/s].
            wanted: those that are to be [rad/s].
            how: largest change of the hand's velocity [m/s] and of a joint's [rad/s], and damping.
        """
        found = before.copy()
        _step(jacobian, wanted, how, found, self._work)
        return found


@compiled
def _serve_alone(
    first: Float64[np.ndarray, "m k"],
    jacobian: Float64[np.ndarray, "r k"],
    reference: Float64[np.ndarray, " r"],
    low: Float64[np.ndarray, " k"],
    high: Float64[np.ndarray, " k"],
    near: Float64[np.ndarray, "p k"],
    least: Float64[np.ndarray, " p"],
    held: Float64[np.ndarray, " p"],
    damping: float,
    found: Float64[np.ndarray, " k"],
    work: Work,
) -> None:
    """See `serve`.

    Args:
        first: see there.
        jacobian: see there.
        reference: see there.
        low: least velocities [rad/s].
        high: largest ones [rad/s].
        near: rows of pairs.
        least: of their products with velocities [m/s].
        held: which pairs have come to their end; overwritten.
        damping: see `serve`.
        found: velocities, moved on [rad/s].
        work: room.
    """
    copy_rows(first, 0, len(first), work.kept, 0)
    copy_rows(jacobian, 0, len(jacobian), work.rows, 0)
    ask(reference, 0, len(jacobian), found, work)
    go(len(first), len(jacobian), low, high, near, least, held, damping, found, work)


@compiled
def _turn(
    jacobian: Float64[np.ndarray, "6 k"],
    reference: Float64[np.ndarray, "6"],
    low: Float64[np.ndarray, " k"],
    high: Float64[np.ndarray, " k"],
    near: Float64[np.ndarray, "p k"],
    least: Float64[np.ndarray, " p"],
    held: Float64[np.ndarray, " p"],
    how: tuple[float, float, float],
    found: Float64[np.ndarray, " k"],
    work: Work,
) -> None:
    """See `ArmServer.turn`.

    Args:
        jacobian: see there.
        reference: see there.
        low: least velocities [rad/s].
        high: largest ones [rad/s].
        near: rows of pairs.
        least: of their products with velocities [m/s].
        held: which pairs have come to their end; overwritten.
        how: see `ArmServer.turn`.
        found: velocities, moved on [rad/s].
        work: room.
    """
    moving, turning, speed = how
    copy_rows(jacobian, 0, 3, work.rows, 0)
    ask(reference, 0, 3, found, work)
    go(0, 3, low, high, near, least, held, moving, found, work)
    for i in range(len(found)):
        work.low[i] = max(low[i], min(found[i], -speed))
        work.high[i] = min(high[i], max(found[i], speed))
    copy_rows(jacobian, 0, 3, work.kept, 0)
    copy_rows(jacobian, 3, 6, work.rows, 0)
    ask(reference, 3, 3, found, work)
    go(3, 3, work.low, work.high, near, least, held, turning, found, work)


@compiled
def _step(
    jacobian: Float64[np.ndarray, "6 k"],
    wanted: Float64[np.ndarray, " k"],
    how: tuple[float, float, float],
    found: Float64[np.ndarray, " k"],
    work: Work,
) -> None:
    """See `ArmServer.step`.

    Args:
        jacobian: see there.
        wanted: see there.
        how: see there.
        found: the velocities before, moved on [rad/s].
        work: room.
    """
    hand, joint, damping = how
    k = len(found)
    for i in range(k):
        work.low[i], work.high[i] = found[i] - joint, found[i] + joint
    far = 0.0
    for row in range(3):
        ahead = 0.0
        for i in range(k):
            ahead += jacobian[row, i] * (wanted[i] - found[i])
        work.missing[row] = ahead
        far += ahead * ahead
    share = min(1.0, hand / max(math.sqrt(far), 1e-12))
    for row in range(3):
        work.missing[row] *= share
    copy_rows(jacobian, 0, 3, work.rows, 0)
    # There are no pairs.
    near, none = work.kept[:0], work.change[:0]
    go(0, 3, work.low, work.high, near, none, none, damping, found, work)
    copy_rows(jacobian, 0, 3, work.kept, 0)
    for i in range(k):
        for j in range(k):
            work.rows[i, j] = 1.0 if i == j else 0.0
        work.missing[i] = wanted[i] - found[i]
    go(3, k, work.low, work.high, near, none, none, damping, found, work)
