"""`HandLoads`: masses in the hands, apart from the body's own by the motion of the hands."""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.estimation._config import PayloadBelief
from poise.estimation._payload_memory import HAND
from poise.robots import GRAVITY, Robot

_AT_REST = 0.05
"""Motion in the torso that counts as none: resting arms swing as much when a robot walks [m]."""

_VIOLENT = 1e6
"""Bound of the square of a change of the force over `PayloadBelief.push`."""


class HandLoads:
    """Masses in the hands, from the contact forces while hands move.

    A mass mu in a hand, at the place r with velocity v, takes mu (a - g) of force and, about the
    robot's centre of mass c, mu (r - c) x (a - g) of moment. With hands at rest a mass and an
    offset of the body do the same; when a hand moves, its moment goes along and the body's stays.
    So both, the moment y that nothing else explains and the columns B of unit masses, go through a
    washout in the torso's axes, and a Kalman filter follows mu:

        y - y_slow = (B - B_slow) mu

    At rest the right side is zero, and mu stays as it is. Its random walk is by the way of the
    hand, since a hand at rest grips nothing. Measurements count little while the force changes, as
    by a push or a load put on or leaned on, and until the washout has forgotten that.

    With (r - c) x a = ((r - c) x v)' + c' x v and one low-pass on v, (r - c) x v, c' x v and r - c
    nothing is differentiated.
    """

    def __init__(self, robot: Robot, belief: PayloadBelief) -> None:
        self._model = robot.model
        self._frames = [robot.frame_id(name) for name in robot.hands]
        self._belief = belief
        self.reset()

    def __len__(self) -> int:
        return len(self._frames)

    def reset(self) -> None:
        """Restart with empty hands."""
        self.held: Float64[np.ndarray, " h"] = np.zeros(len(self))  # by the robot's mass
        self._covariance = self._belief.likely_held**2 * np.eye(len(self))
        self.restart()

    def restart(self) -> None:
        """Discard the motion of the hands, after a jump of time."""
        self._anchors: list[list[float] | None] = [None] * len(self)
        self._slow: Float64[np.ndarray, "6 k"] | None = None
        self._pushed = 0.0

    def columns(
        self, measured: Float64[np.ndarray, " k"], low: Float64[np.ndarray, " k"]
    ) -> Float64[np.ndarray, "6 h"]:
        """Return B, force and moment of a unit mass in each hand."""
        measured, low = measured.reshape(-1, HAND), low.reshape(-1, HAND)
        found = (measured[:, :6] - low[:, :6]) / self._belief.smoothing
        found[:, 2] += GRAVITY
        found[:, 3:] += low[:, 6:9]
        found[:, 3] += GRAVITY * low[:, 10]
        found[:, 4] -= GRAVITY * low[:, 9]
        return found.T

    def correct(
        self,
        left: Float64[np.ndarray, "6"],
        columns: Float64[np.ndarray, "6 h"],
        data: pin.Data,
        torso: pin.SE3,
        dt: float,
    ) -> Float64[np.ndarray, "4"]:
        """Update the masses; return the change of the body's mass and first moment, by the mass."""
        b, P = self._belief, self._covariance
        for k, way in enumerate(self._moved(data, torso)):
            P[k, k] += b.held_walk**2 * way
        seen = np.empty((6, 1 + len(self)))
        seen[:, 0], seen[:, 1:] = left, columns
        torso_R_world = torso.rotation.T
        seen[:3], seen[3:] = torso_R_world.dot(seen[:3]), torso_R_world.dot(seen[3:])
        slow = seen if self._slow is None else self._slow
        kept = math.exp(-dt / b.washout)
        self._slow = slow = seen + kept * (slow - seen)
        changed = seen - slow
        y, B, before = changed[3:, 0], changed[3:, 1:], self.held
        force = changed[:3, 0] - changed[:3, 1:].dot(before)
        pushed = min(float(force.dot(force)) / (b.push * GRAVITY) ** 2, _VIOLENT)
        # A push passes through zero as it changes; the washout has its moment for longer.
        self._pushed = pushed = max(pushed, kept * self._pushed)
        noise = b.held_noise * GRAVITY * (1.0 + pushed)
        BP = B.dot(P)
        gain = np.linalg.solve(BP.dot(B.T) + (noise**2 / dt) * np.eye(3), BP).T
        P -= gain.dot(BP)
        held = before + gain.dot(y - B.dot(before))
        self.held = np.minimum(np.maximum(held, 0.0), b.held_max)
        given = self.held - before
        m_x, m_y, _ = slow[3:, 1:].dot(given).tolist()
        return np.array([given.sum(), -m_y / GRAVITY, m_x / GRAVITY, 0.0])

    def _moved(self, data: pin.Data, torso: pin.SE3) -> list[float]:
        """Return the way of each hand in the torso since the last call [m]."""
        ways = [0.0] * len(self)
        for k, frame in enumerate(self._frames):
            place = pin.updateFramePlacement(self._model, data, frame).translation
            here = torso.actInv(place).tolist()
            anchor = self._anchors[k]
            way = 0.0 if anchor is None else math.dist(here, anchor)
            if anchor is None or way > _AT_REST:
                ways[k], self._anchors[k] = way, here
        return ways
