"""`ArmClearance`: arms that are led are kept off the body and off each other in their own model."""

import math

import numpy as np
from jaxtyping import Float64, Int64

from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot
from poise.stack import SelfCollisionLimit, SurfaceContact

_MARGIN = 0.03
"""Distance that is kept [m]: more than what the stack's own limit keeps, so that arms come to rest
here and lean on no limit there."""

_BRAKING, _HARD_BRAKING = 2.0, 6.0
"""With how much links are to come to rest that come near each other, less than what hands brake
with, and with how much they do if need be [m/s^2]."""

_SPARE = 0.01
"""How much nearer than to the margin links may come for that [m]."""

_SWEEPS = 8
"""How often all near pairs are gone through; with two or three it is settled after as many."""

_NO_MOBILITY = 1e-9
"""Square of the velocity for a radian a second below which arms do not move a pair [m^2]."""


class ArmClearance:
    """Takes from the velocities of arms what would bring links too near each other.

    A distance d may shrink no faster than so that it comes to rest at the margin,

        d_dot >= -min(sqrt(2 b (d - margin)), (d - margin) / 2 dt)        and 0 nearer than that

    and of the velocities that do so those nearest to the wanted ones are found by projecting on one
    pair after the other (Hildreth 1957, without memory). The rest of the robot stands as at rest.

    Args:
        robot: the robot.
        columns: coordinates of the arms' joints in `v`.
        dt: length of a tick [s].
    """

    def __init__(self, robot: Robot, columns: Int64[np.ndarray, " n"], dt: float) -> None:
        limit = SelfCollisionLimit(margin=_MARGIN)
        limit.bind(robot)
        # Legs that stand are none of the arms' concern.
        self._rows = limit.rows_for([SurfaceContact(sole) for sole in robot.soles])
        self._dynamics, self._still = Dynamics(robot), np.zeros(robot.nv)
        self._columns, self._dt = columns, dt
        self._near: list[tuple[Float64[np.ndarray, " n"], float, float]] = []

    def update(self, q: Float64[np.ndarray, " nq"]) -> None:
        """Finds the pairs that are near each other.

        Args:
            q: configuration [m, rad].
        """
        if self._rows is None:
            return
        self._dynamics.update(RobotState(q, self._still))
        self._rows.evaluate_alone(self._dynamics)
        jacobian = self._rows.jacobian[:, self._columns]
        squares = np.einsum("ij,ij->i", jacobian, jacobian).tolist()
        self._near = [
            (row, square, room)
            for row, square, room in zip(jacobian, squares, self._rows.rooms(), strict=True)
            if room < math.inf and square > _NO_MOBILITY
        ]

    def near(
        self, own: Int64[np.ndarray, " k"], wanted: Float64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, "p k"], Float64[np.ndarray, " p"]]:
        """Rows of the pairs that are near, and the least that each may be times velocities [m/s].

        As is planned, not as hard as need be.

        Args:
            own: joints of one arm.
            wanted: velocities of all of them; what the others do is taken off [rad/s].
        """
        if not self._near:
            return np.zeros((0, len(own))), np.zeros(0)
        matrix = np.array([row for row, _, _ in self._near])
        rows = np.ascontiguousarray(matrix[:, own])
        least = np.array([-self._fastest(room, _BRAKING) for _, _, room in self._near])
        return rows, least - matrix @ wanted + rows @ wanted[own]

    def keep(self, wanted: Float64[np.ndarray, " n"], *, hard: bool) -> Float64[np.ndarray, " n"]:
        """Velocities near the wanted ones that keep links apart [rad/s].

        Args:
            wanted: velocities of the arms' joints [rad/s].
            hard: whether as hard is braked as need be, and not as is planned.
        """
        braking, spare = (_HARD_BRAKING, _SPARE) if hard else (_BRAKING, 0.0)
        bounds = [-self._fastest(room + spare, braking) for _, _, room in self._near]
        found = wanted.copy()
        for _ in range(_SWEEPS):
            moved = False
            for (row, square, _), bound in zip(self._near, bounds, strict=True):
                missing = bound - float(row @ found)
                if missing > 0.0:
                    found += row * (missing / square)
                    moved = True
            if not moved:
                break
        return found

    def _fastest(self, room: float, braking: float) -> float:
        """How fast a distance may shrink that has so much room left [m/s]."""
        if room <= 0.0:
            return 0.0
        return min(math.sqrt(2.0 * braking * room), 0.5 * room / self._dt)
