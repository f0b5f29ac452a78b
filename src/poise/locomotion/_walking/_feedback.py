"""`StepCatcher`: how far the next foothold moves to catch the robot.

`DcmFeedback`: the ZMP that brings the robot back to its reference.
`PlanShift`: the walk carried on beside its plan, and a foothold moved to catch the robot.
"""

import math
from collections.abc import Sequence

from poise.locomotion._support import Point, SupportPolygon
from poise.locomotion._walking._footsteps import FootstepPlan, Placement


class DcmFeedback:
    """Feedback of the divergent component of motion, inside the soles.

    With xi = c + cdot / omega and the reference's own ZMP r_ref = c_ref - cdd_ref / omega^2,

        r = r_ref + (1 + k / omega) (xi - xi_ref)        taken into the support polygon
        cdd = omega^2 (c - r)

    as Englsberger, Ott, Albu-Schaeffer (2015, "Three-Dimensional Bipedal Walking Control Based on
    Divergent Component of Motion") have it; the error dies out with the rate k while the ZMP is
    free.

    Args:
        omega: natural frequency of the COM over the ground [1/s].
        gain: k [1/s].

    Attributes:
        error: of the divergent component, xi - xi_ref [m].
        zmp: r [m].
    """

    def __init__(self, omega: float, gain: float) -> None:
        self.omega, self._gain = omega, 1.0 + gain / omega
        self.error: Point = (0.0, 0.0)
        self.zmp: Point = (0.0, 0.0)

    def acceleration(
        self,
        com: Point,
        velocity: Point,
        reference: tuple[Sequence[float], Sequence[float], Sequence[float]],
        support: SupportPolygon,
    ) -> Point:
        """The COM's horizontal acceleration [m/s^2].

        Args:
            com: as measured [m].
            velocity: as measured [m/s].
            reference: position, velocity and acceleration of the COM.
            support: where the ZMP can be.
        """
        w = self.omega
        wanted, error = [0.0, 0.0], [0.0, 0.0]
        for k in (0, 1):
            position, speed, pull = (part[k] for part in reference)
            error[k] = com[k] - position + (velocity[k] - speed) / w
            wanted[k] = position - pull / (w * w) + self._gain * error[k]
        self.error = (error[0], error[1])
        self.zmp = support.nearest((wanted[0], wanted[1]))
        return (w * w * (com[0] - self.zmp[0]), w * w * (com[1] - self.zmp[1]))


Pair = tuple[float, float]


class PlanShift:
    """What moved footholds do to the references, exactly, on the linear inverted pendulum.

    If from time T on the ZMP's reference lies D beside its plan, a divergent component xi that
    stays bounded has to be D e^{-omega (T - t)} beside its own before, and D after. The COM
    follows with cdot = omega (xi - c).

    Args:
        omega: natural frequency of the COM over the ground [1/s].

    Attributes:
        settled: how far the ZMP's reference lies beside the plan now [m].
        coming: how much farther it will from the next foothold on [m].
        com: how far the COM's reference lies beside the plan [m].
        velocity: rate of `com` [m/s].
        acceleration: rate of `velocity` [m/s^2].
    """

    def __init__(self, omega: float) -> None:
        self._omega = omega
        self.settled: Pair = (0.0, 0.0)
        self.coming: Pair = (0.0, 0.0)
        self.com: Pair = (0.0, 0.0)
        self.velocity: Pair = (0.0, 0.0)
        self.acceleration: Pair = (0.0, 0.0)

    def advance(self, dt: float, left: float) -> None:
        """Moves on.

        Args:
            dt: since the last call [s].
            left: until the ZMP goes over to the next foothold [s].
        """
        w, fade = self._omega, math.exp(-self._omega * max(left, 0.0))
        blend = math.exp(-w * dt)
        com, velocity, acceleration = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
        for k in (0, 1):
            ahead = self.coming[k] * fade
            xi = self.settled[k] + ahead
            com[k] = xi + (self.com[k] - xi) * blend
            velocity[k] = w * (xi - com[k])
            acceleration[k] = w * (w * ahead - velocity[k])
        self.com, self.velocity = (com[0], com[1]), (velocity[0], velocity[1])
        self.acceleration = (acceleration[0], acceleration[1])

    def land(self, shift: Pair) -> None:
        """A foot came down so far beside its plan [m]."""
        self.settled, self.coming = shift, (0.0, 0.0)


_TRUSTED = 0.6
"""Share of the way from the ZMP to the edge of the sole that feedback is left to deal with."""

_RATE = 1.0
"""How fast a foothold moves at most [m/s]: the foot has to follow."""

_RETURN = 0.06
"""How far each step comes back to the plan after a foothold that moved [m]."""


class StepCatcher:
    """Moves the next foothold where the ZMP alone cannot bring the robot back.

    An error e of the divergent component grows to e exp(omega tau) until the next foot takes over
    in tau; a foothold that far beside its plan makes it vanish. What the ZMP can still do within
    the sole is taken off first, along and across the standing foot by themselves. Without an error
    a walk that has left its plan comes back to it, step by step.

    Args:
        plan: the steps.
        omega: natural frequency of the COM over the ground [1/s].
        farthest: that a foothold moves [m].
        margin: of the ZMP inside the soles' edges [m].
        reach: farthest that a foot lands ahead of or behind the other one [m].
    """

    def __init__(
        self, plan: FootstepPlan, omega: float, farthest: float, margin: float, reach: float
    ) -> None:
        self._plan, self._omega = plan, omega
        self._farthest, self._margin, self._reach = farthest, margin, reach

    def advance(
        self,
        step: int,
        stance: Placement,
        error: Point,
        zmp: Point,
        shift: PlanShift,
        left: float,
        dt: float,
    ) -> None:
        """Chooses `shift.coming` anew.

        Args:
            step: the step under way.
            stance: where the foot stands that carries the robot.
            error: of the divergent component, from its shifted reference [m].
            zmp: reference of the ZMP [m].
            shift: what the walk has left its plan by.
            left: until the next foot takes over [s].
            dt: since the last call [s].
        """
        growth = math.exp(self._omega * left)
        cos, sin = math.cos(stance.yaw), math.sin(stance.yaw)
        raw = [error[k] + shift.coming[k] / growth for k in (0, 1)]
        back = [_clip(-shift.settled[k], _RETURN) for k in (0, 1)]
        off = (zmp[0] - stance.position[0], zmp[1] - stance.position[1])
        sizes = self._plan.sizes[1 - self._plan.steps[step].foot]
        free: list[float] = []
        for axis in (0, 1):
            e = _along(raw, cos, sin, axis)
            # The return is wanted: only what is not explained by it has to be caught.
            e -= _along(back, cos, sin, axis) / growth
            r = _along(off, cos, sin, axis)
            room = 0.5 * sizes[axis] - self._margin - math.copysign(1.0, e) * r
            left_over = max(abs(e) - _TRUSTED * max(room, 0.0), 0.0)
            free.append(_clip(math.copysign(left_over, e) * growth, self._farthest))
        wanted = [
            back[0] + cos * free[0] - sin * free[1],
            back[1] + sin * free[0] + cos * free[1],
        ]
        wanted = self._allowed(step, stance, shift.settled, wanted)
        most = _RATE * dt
        shift.coming = (
            shift.coming[0] + _clip(wanted[0] - shift.coming[0], most),
            shift.coming[1] + _clip(wanted[1] - shift.coming[1], most),
        )

    def _allowed(
        self, step: int, stance: Placement, settled: Point, wanted: list[float]
    ) -> list[float]:
        """The nearest shift that keeps the feet apart, within reach, and on level ground."""
        plan, goal = self._plan, self._plan.steps[step].goal
        foot = plan.steps[step].foot
        cos, sin = math.cos(stance.yaw), math.sin(stance.yaw)
        base = [goal.position[k] + settled[k] - stance.position[k] for k in (0, 1)]
        ahead, aside = _along(base, cos, sin, 0), _along(base, cos, sin, 1)
        x = ahead + _along(wanted, cos, sin, 0)
        y = aside + _along(wanted, cos, sin, 1)
        far = max(self._reach, abs(ahead))
        x = min(max(x, -far), far)
        side = 1.0 if foot == 0 else -1.0
        near = min(plan.clearance + 0.5 * (plan.sizes[0][1] + plan.sizes[1][1]), abs(aside))
        y = side * min(max(side * y, near), abs(aside) + self._farthest)
        dx, dy = x - ahead, y - aside
        moved = [cos * dx - sin * dy, sin * dx + cos * dy]
        if plan.ground.platforms and not self._carries(goal, settled, moved, plan.sizes[foot]):
            moved = [-settled[0], -settled[1]]
        return moved

    def _carries(
        self, goal: Placement, settled: Point, moved: list[float], size: tuple[float, float]
    ) -> bool:
        x, y = (goal.position[k] + settled[k] + moved[k] for k in (0, 1))
        place = Placement(position=(x, y, goal.position[2]), yaw=goal.yaw)
        heights = self._plan.ground.heights(place.grid(*size))
        return bool(abs(heights - goal.position[2]).max() < 1e-3)


def _along(vector: list[float] | Point, cos: float, sin: float, axis: int) -> float:
    x, y = vector
    return cos * x + sin * y if axis == 0 else cos * y - sin * x


def _clip(value: float, most: float) -> float:
    return min(max(value, -most), most)
