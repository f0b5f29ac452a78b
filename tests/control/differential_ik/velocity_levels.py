"""Levels of joint velocities without a robot, solved in closed form."""

import numpy as np

from poise.control._differential_ik._closed_form import RANK, ClosedForm, WithinBounds
from poise.control._differential_ik._kernels import PriorityRows, VelocityLevels


def stacked(levels, exact=1, limits=None):
    """Levels one below the other, and behind them rows that may not be broken."""
    n = levels[0].jacobian.shape[1]
    none = PriorityRows(np.zeros((0, n)), *np.zeros((3, 0)))
    parts = [*levels, none if limits is None else limits]
    sizes = [len(part.velocity) for part in parts]
    ends = np.cumsum([0, *sizes])
    return VelocityLevels(
        jacobian=np.concatenate([part.jacobian for part in parts]),
        velocity=np.concatenate([part.velocity for part in parts]),
        weight=np.concatenate([part.weight for part in parts]),
        scale=np.concatenate([part.scale for part in parts]),
        rows=np.arange(ends[-2]),
        ends=ends[:-1].copy(),
        limits=np.arange(ends[-2], ends[-1]),
        exact=exact,
    )


def solve_levels(levels, joint_weight, *, exact=1, rank=RANK):
    return ClosedForm(len(joint_weight), rank).solve(stacked(levels, exact), joint_weight)


def solve_within_bounds(levels, joint_weight, lower, upper, *, exact=1, limits=None):
    found = stacked(levels, exact, limits)
    within = WithinBounds(ClosedForm(len(joint_weight), RANK))
    return within.solve(found, found.with_limits(), joint_weight, lower, upper)
