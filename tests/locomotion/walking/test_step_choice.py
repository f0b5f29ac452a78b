"""Place and time of a touchdown, against a pendulum that is integrated, and a dense search."""

import math

import numpy as np
import pytest

from poise.locomotion._walking._step_planner import (
    Pendulum,
    StepBounds,
    SwingLimits,
    choose_step,
)

OMEGA = 3.7
BOUNDS = StepBounds(near=0.12, wide=0.5, reach=0.4, beside=0.2)
SWING = SwingLimits(
    place=(0.0, 0.2), speed=2.5, elapsed=0.1, shortest=0.25, usual=0.42, longest=0.6
)


def on_plan(left=0.32, **changes):
    """A step whose divergent component is where it should be."""
    goal, zmp, end = (0.12, 0.16), (0.0, 0.0), (-0.01, 0.0)
    slope = np.subtract(end, zmp) / (OMEGA * left)
    xi = np.array(zmp) + slope + math.exp(-OMEGA * left) * (np.array(goal) - end - slope)
    values = {
        "xi": tuple(xi), "zmp": zmp, "zmp_end": end, "goal": goal, "foothold": (0.15, 0.2),
        "gain": 0.85, "room": (0.04, 0.01), "omega": OMEGA,
    }  # fmt: skip
    return Pendulum(**(values | changes))


def pushed(by, **changes):
    plan = on_plan(**changes)
    return plan._replace(xi=(plan.xi[0] + by[0], plan.xi[1] + by[1]))


def test_what_the_sole_can_do_is_left_to_it():
    step = choose_step(pushed((0.02, -0.004)), BOUNDS, SWING)
    assert (step.x, step.y, step.left) == pytest.approx((0.15, 0.2, 0.32))


@pytest.mark.parametrize("push", [(0.06, 0.0), (-0.07, 0.02), (0.0, 0.05), (0.05, 0.04)])
def test_the_foothold_lies_where_the_pendulum_gets_to(push):
    pendulum = pushed(push)
    step = choose_step(pendulum, BOUNDS, SWING)
    assert step.missed < 1e-9
    # Integrate with the ZMP at the edge of its room on the side of the push.
    xi, ticks = np.array(pendulum.xi), 4000
    dt = step.left / ticks
    offset = np.sign(push) * np.array(pendulum.room)
    for k in range(ticks):
        ratio = (k + 0.5) / ticks
        zmp = np.array(pendulum.zmp) + ratio * np.subtract(pendulum.zmp_end, pendulum.zmp) + offset
        xi = zmp + (xi - zmp) * math.exp(OMEGA * dt)
    moved = np.array(pendulum.goal) + pendulum.gain * (
        np.array((step.x, step.y)) - pendulum.foothold
    )
    for axis in (0, 1):
        if abs(push[axis]) > 0.03:
            assert xi[axis] == pytest.approx(moved[axis], abs=1e-4)


def test_every_choice_is_within_bounds_reach_and_time():
    rng = np.random.default_rng(0)
    for _ in range(500):
        swing = SWING._replace(
            elapsed=rng.uniform(0.0, 0.7), place=(rng.uniform(-0.4, 0.4), rng.uniform(0.12, 0.5))
        )
        step = choose_step(pushed(rng.normal(0.0, 0.2, 2)), BOUNDS, swing)
        assert BOUNDS.near - 1e-9 <= step.y <= BOUNDS.wide + 1e-9
        assert abs(step.x) <= BOUNDS.reach + 1e-9
        assert step.left >= 0.02
        whole = swing.elapsed + step.left
        assert whole <= max(swing.longest, swing.elapsed + 0.02) + 1e-9
        # What should be down already comes down as soon as it can.
        assert whole >= min(swing.shortest, swing.usual) - 1e-9 or step.left == 0.02
        gone = math.dist((step.x, step.y), swing.place)
        assert gone <= swing.speed * step.left + 1e-9


def test_no_other_time_costs_less():
    pendulum = pushed((0.09, 0.03))
    best = choose_step(pendulum, BOUNDS, SWING)
    for usual in np.linspace(SWING.shortest, SWING.longest, 200):
        # A search over one time only: its own cost of time does not count.
        one = SWING._replace(shortest=usual, usual=usual, longest=usual)
        step = choose_step(pendulum, BOUNDS, one)
        late = (usual - SWING.usual) / 0.15
        assert step.cost + late**2 >= best.cost - 0.15
