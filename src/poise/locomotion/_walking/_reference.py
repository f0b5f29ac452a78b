"""`WalkReference`: where ZMP, centre of mass and body should be all through a walk."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise.dynamics import least_jerk
from poise.locomotion._pendulum import natural_frequency
from poise.locomotion._preview import PreviewControl
from poise.locomotion._walking._footsteps import FootstepPlan

_DT = 0.005
"""Grid of the references [s]; between its points they are interpolated linearly."""

_AHEAD = 3.0
"""How far the preview looks ahead [s]: what is farther has 1e-4 of its weight."""

_CLOSE = 0.3
"""How long the ZMP takes from the last foot to the middle at the end [s]."""


class ReferencePoint(NamedTuple):
    """References at one moment.

    Attributes:
        com: position [m], velocity [m/s] and acceleration [m/s^2] of the COM, a row each.
        displacement: of the body since the beginning along x, y, z [m] and about z [rad], and its
            first and second rates, a row each.
    """

    com: Float64[np.ndarray, "3 3"]
    displacement: Float64[np.ndarray, "3 4"]


class WalkReference:
    """References of a plan, computed once.

    The ZMP stands in the middle of the foot that carries and goes over to the next while both
    stand. `PreviewControl` gives the horizontal motion of the COM from it. Its height follows the
    lower foot, its heading the mean of both.

    Args:
        plan: the steps.

    Attributes:
        omega: natural frequency of the pendulum [1/s].
        height: of the COM above the ground while walking [m].
        time: grid [s].
        zmp: reference of the ZMP on the grid [m].
        com: position, velocity and acceleration of the COM on the grid [m, s].
        displacement: of the body on the grid, see `ReferencePoint`.
    """

    def __init__(self, plan: FootstepPlan) -> None:
        feet = 0.5 * sum(p.position[2] for p in plan.start)
        standing = plan.com[2] - feet
        self.height = standing - plan.gait.crouch
        # Legs that sway along with the body make a slower pendulum, as long as a higher one.
        pendulum = plan.leg_factor * self.height
        self.omega = natural_frequency(pendulum)
        self.time: Float64[np.ndarray, " T"] = np.arange(0.0, plan.duration + _DT, _DT)
        self.zmp: Float64[np.ndarray, "T 2"] = _zmp(plan, self.time)
        rise = np.concatenate([_rise(plan, self.time), _heading(plan, self.time)], axis=2)
        com = _preview(pendulum, np.array(plan.com[:2]), self.zmp)
        crouch = -plan.gait.crouch * _least_jerk(self.time, 0.0, plan.gait.shift_time)
        self.com: Float64[np.ndarray, "T 3 3"] = np.concatenate(
            [com, rise[:, :, :1] + crouch[:, :, None]], axis=2
        )
        self.com[:, 0, 2] += standing
        self.displacement: Float64[np.ndarray, "T 3 4"] = np.concatenate([com, rise], axis=2)
        self.displacement[:, 0] -= self.displacement[0, 0]
        flat = np.concatenate([self.com.reshape(-1, 9), self.displacement.reshape(-1, 12)], axis=1)
        self._table = np.ascontiguousarray(flat)
        self._last = len(self.time) - 2

    def at(self, time: float) -> ReferencePoint:
        """The references at a time from the beginning of the walk [s]; the last ones after it."""
        grid = max(time, 0.0) / _DT
        k = min(int(grid), self._last)
        before = self._table[k]
        row = before + min(grid - k, 1.0) * (self._table[k + 1] - before)
        return ReferencePoint(row[:9].reshape(3, 3), row[9:].reshape(3, 4))


def _zmp(plan: FootstepPlan, time: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, "T 2"]:
    """From the middle over to each foot that carries, and back to the middle."""
    knots = [(0.5 * plan.gait.shift_time, plan.com[:2])]
    for i, step in enumerate(plan.steps):
        stance = plan.zmp(1 - step.foot, plan.placements(i)[1 - step.foot])
        knots += [(plan.lift_off(i), stance), (plan.touchdown(i), stance)]
    end = plan.rest(plan.placements(plan.count))
    knots.append((plan.touchdown(plan.count - 1) + _CLOSE, end))
    at, points = np.array([t for t, _ in knots]), np.array([p for _, p in knots])
    return np.stack([np.interp(time, at, points[:, axis]) for axis in (0, 1)], axis=1)


def _rise(plan: FootstepPlan, time: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, "T 3 1"]:
    """Height of the lower of the two feet that stand: the farther leg has to reach it.

    It changes while one foot is in the air, so up after the lower foot has left the ground, and
    down before the lower one comes to it.
    """
    rise = np.zeros((len(time), 3, 1))
    lows = [min(p.position[2] for p in plan.placements(i)) for i in range(plan.count + 1)]
    rise[:, 0] = lows[0]
    for i, (before, after) in enumerate(pairwise(lows)):
        if after != before:
            phase = _least_jerk(time, plan.lift_off(i), plan.gait.swing_time)
            rise[:, :, 0] += (after - before) * phase
    return rise


def _heading(plan: FootstepPlan, time: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, "T 3 1"]:
    """Mean heading of the feet, smoothly from one stand to the next."""
    # SciPy's splines take a third of a second to import, and only a walk with a plan needs them.
    from scipy.interpolate import make_interp_spline

    half = 0.5 * plan.gait.double_support
    at = [plan.lift_off(0) - half]
    at += [plan.touchdown(i) + half for i in range(plan.count)]
    means = [0.5 * sum(place.yaw for place in plan.placements(i)) for i in range(plan.count + 1)]
    rest = [(1, 0.0), (2, 0.0)]
    spline = make_interp_spline(at, np.array(means), k=5, bc_type=(rest, rest))
    inside = np.clip(time, at[0], at[-1])
    moving = (time > at[0]) & (time < at[-1])
    heading = np.stack(
        [spline(inside), moving * spline(inside, nu=1), moving * spline(inside, nu=2)]
    )
    return heading.T[:, :, None]


def _preview(
    height: float, start: Float64[np.ndarray, "2"], zmp: Float64[np.ndarray, "T 2"]
) -> Float64[np.ndarray, "T 3 2"]:
    """The COM that preview control makes of a ZMP reference, from rest."""
    control = PreviewControl(height, _DT, round(_AHEAD / _DT))
    ahead = np.concatenate([zmp[1:], np.repeat(zmp[-1:], control.length, axis=0)])
    driven = np.stack([np.correlate(ahead[:, k], control.f, "valid") for k in (0, 1)], axis=1)
    # A window that ends too soon asks a little less jerk than a reference at rest needs.
    driven *= 1.0 / control.dc_gain
    closed = control.A - np.outer(control.b, control.K)
    state = np.zeros((3, 2))
    state[0] = start
    states = np.empty((len(zmp), 3, 2))
    for k in range(len(zmp)):
        states[k] = state
        state = closed @ state + np.outer(control.b, driven[k])
    return states


def _least_jerk(
    time: Float64[np.ndarray, " T"], start: float, duration: float
) -> Float64[np.ndarray, "T 3"]:
    """`least_jerk` at each moment of a grid."""
    return np.array([least_jerk(t, start, duration) for t in time.tolist()])
