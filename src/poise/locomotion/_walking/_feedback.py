"""`DcmFeedback`: the ZMP that brings the robot back to its reference.

`PlanShift`: the walk carried on beside its plan after a foothold that was moved.
`StepCatcher`: how far the next foothold moves to catch the robot.

All of it lies in the horizontal plane: vectors are x and y in the world. Two numbers are a third as
expensive plain as in arrays.
"""

import math
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise.locomotion._support import Point
from poise.locomotion._walking._footsteps import FootstepPlan
from poise.locomotion._walking._ground import Placement

Vector2 = Float64[np.ndarray, "2"]


@runtime_checkable
class ZmpRegion(Protocol):
    """Where the ZMP can be: a `SupportPolygon`, or what stands in for one."""

    def nearest(self, point: Point) -> Point:
        """The nearest point inside."""
        ...


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
        self.error: Vector2 = np.zeros(2)
        self.zmp: Vector2 = np.zeros(2)

    def acceleration(
        self,
        com: Vector2,
        velocity: Vector2,
        reference: Float64[np.ndarray, "3 2"],
        support: ZmpRegion,
    ) -> Vector2:
        """The COM's horizontal acceleration [m/s^2].

        Args:
            com: as measured [m].
            velocity: as measured [m/s].
            reference: position [m], velocity [m/s] and acceleration [m/s^2] of the COM, a row each.
            support: where the ZMP can be.
        """
        w = self.omega
        (px, py), (rx, ry), (sx, sy) = reference.tolist()
        (cx, cy), (vx, vy) = com.tolist(), velocity.tolist()
        ex, ey = cx - px + (vx - rx) / w, cy - py + (vy - ry) / w
        x, y = support.nearest(
            (px - sx / (w * w) + self._gain * ex, py - sy / (w * w) + self._gain * ey)
        )
        self.error, self.zmp = np.array((ex, ey)), np.array((x, y))
        return np.array((w * w * (cx - x), w * w * (cy - y)))


class PlanShift:
    """What moved footholds do to the references, exactly, on the linear inverted pendulum.

    If from time T on the ZMP's reference lies D beside its plan, a divergent component xi that
    stays bounded has to be D e^{-omega (T - t)} beside its own before, and D after. The COM
    follows with cdot = omega (xi - c).

    Args:
        omega: natural frequency of the COM over the ground [1/s].

    Attributes:
        settled: how far the feet that stand are beside the plan [m].
        coming: how much farther the next foothold will be [m].
        com: how far the COM's reference lies beside the plan [m], with its velocity [m/s] and
            acceleration [m/s^2], a row each.
    """

    def __init__(self, omega: float) -> None:
        self._omega = omega
        self.settled: Vector2 = np.zeros(2)
        self.coming: Vector2 = np.zeros(2)
        # What of it the ZMP has not gone over to yet [m], and in what time it will [s].
        self._landed: Vector2 = np.zeros(2)
        self._landed_left = 0.0
        self.com: Float64[np.ndarray, "3 2"] = np.zeros((3, 2))

    def advance(self, dt: float, left: float) -> None:
        """Moves on.

        Args:
            dt: since the last call [s].
            left: until the ZMP goes over to the next foothold [s].
        """
        w = self._omega
        ahead, kept = math.exp(-w * max(left, 0.0)), math.exp(-w * dt)
        self._landed_left = max(self._landed_left - dt, 0.0)
        if self._landed_left == 0.0:
            self._landed = np.zeros(2)
        near = math.exp(-w * self._landed_left)
        axes: list[tuple[float, float, float]] = []
        for settled, landed, coming, before in zip(
            self.settled.tolist(),
            self._landed.tolist(),
            self.coming.tolist(),
            self.com[0].tolist(),
            strict=True,
        ):
            anticipated = coming * ahead + landed * near
            xi = settled - landed + anticipated
            com = xi + (before - xi) * kept
            velocity = w * (xi - com)
            axes.append((com, velocity, w * (w * anticipated - velocity)))
        self.com = np.array(axes).T

    def land(self, shift: Vector2, left: float) -> None:
        """A foot came down.

        Args:
            shift: how far beside its plan [m].
            left: until the ZMP goes over to it [s].
        """
        self._landed, self._landed_left = shift - self.settled + self._landed, left
        self.settled, self.coming = shift, np.zeros(2)


_TRUSTED = 0.6
"""Part of the distance from the ZMP to the edge of the sole that is left to feedback."""

_RATE = 1.0
"""How fast a foothold moves at most [m/s]: the foot has to follow."""

_RETURN = 0.06
"""How far each step comes back to the plan after a foothold that moved [m]."""

_LEVEL = 1e-3
"""Ground nearer to the height of a foothold than this carries the sole [m]."""


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
        error: Vector2,
        zmp: Vector2,
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
        stand = _Axes.of(stance)
        carrying = 1 - self._plan.steps[step].foot
        bearing = self._plan.bearings[carrying]
        coming, settled = _plain(shift.coming), _plain(shift.settled)
        back_x, back_y = _clipped((-settled[0], -settled[1]), _RETURN)
        # The step back to the plan is intended: only what it does not explain has to be caught.
        along, across = stand.within(
            float(error[0]) + (coming[0] - back_x) / growth,
            float(error[1]) + (coming[1] - back_y) / growth,
        )
        ahead, aside = stand.within(float(zmp[0]) - stand.x, float(zmp[1]) - stand.y)
        caught = (
            growth * self._beyond_feedback(along, 0.5 * bearing.length, ahead - bearing.x),
            growth * self._beyond_feedback(across, 0.5 * bearing.width, aside - bearing.y),
        )
        caught_x, caught_y = stand.without(*_clipped(caught, self._farthest))
        moved = (back_x + caught_x, back_y + caught_y)
        x, y = self._allowed(step, stand, settled, moved)
        by_x, by_y = _clipped((x - coming[0], y - coming[1]), _RATE * dt)
        shift.coming = np.array((coming[0] + by_x, coming[1] + by_y))

    def _beyond_feedback(self, error: float, edge: float, offset: float) -> float:
        """What of an error along the standing foot or across it the ZMP cannot bring back [m].

        Args:
            error: of the divergent component [m].
            edge: of what bears, from its middle [m].
            offset: of the ZMP's reference from there [m].
        """
        room = max(edge - self._margin - math.copysign(1.0, error) * offset, 0.0)
        return math.copysign(max(abs(error) - _TRUSTED * room, 0.0), error)

    def _allowed(self, step: int, stand: "_Axes", settled: Point, shift: Point) -> Point:
        """The nearest shift that keeps the feet apart, within reach, and on level ground."""
        plan, goal, foot = self._plan, self._plan.steps[step].goal, self._plan.steps[step].foot
        planned_x, planned_y = goal.position[0] + settled[0], goal.position[1] + settled[1]
        ahead, aside = stand.within(planned_x - stand.x, planned_y - stand.y)
        by_x, by_y = stand.within(*shift)
        x, y = ahead + by_x, aside + by_y
        far = max(self._reach, abs(ahead))
        x = min(max(x, -far), far)
        side = 1.0 if foot == 0 else -1.0
        near = min(plan.clearance + 0.5 * (plan.sizes[0][1] + plan.sizes[1][1]), abs(aside))
        y = side * min(max(side * y, near), abs(aside) + self._farthest)
        by_x, by_y = stand.without(x - ahead, y - aside)
        place = (planned_x + by_x, planned_y + by_y)
        if plan.ground.platforms and not self._carries(goal, place, plan.sizes[foot]):
            return -settled[0], -settled[1]
        return by_x, by_y

    def _carries(self, goal: Placement, place: Point, size: tuple[float, float]) -> bool:
        """Whether the ground is as high as a goal under all of a sole at another place."""
        x, y = place
        height = goal.position[2]
        sole = Placement(position=(x, y, height), yaw=goal.yaw)
        heights = self._plan.ground.heights(sole.grid(*size))
        return bool(np.abs(heights - height).max() < _LEVEL)


class _Axes(NamedTuple):
    """The axes of a foot that stands, along it and across it.

    Attributes:
        x: of its centre in the world [m].
        y: likewise.
        cos: of its yaw.
        sin: of its yaw.
    """

    x: float
    y: float
    cos: float
    sin: float

    @classmethod
    def of(cls, stance: Placement) -> "_Axes":
        """The axes of a foot that stands there."""
        x, y, _ = stance.position
        return cls(x, y, math.cos(stance.yaw), math.sin(stance.yaw))

    def within(self, x: float, y: float) -> Point:
        """A vector of the world along the foot and across it."""
        return self.cos * x + self.sin * y, self.cos * y - self.sin * x

    def without(self, along: float, across: float) -> Point:
        """A vector along the foot and across it in the world."""
        return self.cos * along - self.sin * across, self.sin * along + self.cos * across


def _plain(vector: Vector2) -> Point:
    x, y = vector.tolist()
    return x, y


def _clipped(vector: Point, most: float) -> Point:
    x, y = vector
    return min(max(x, -most), most), min(max(y, -most), most)
