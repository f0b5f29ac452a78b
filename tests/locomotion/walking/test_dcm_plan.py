"""The divergent component ahead of a walk, against the pendulum integrated in small steps."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from poise.locomotion._walking._dcm import (
    LegMomentum,
    StepTimes,
    hermite_step,
    touchdown_dcm,
    transfer_gain,
)

OMEGA, TIMES = 3.7, StepTimes(swing=0.42, double_support=0.08)
FEET = [(0.0, 0.1), (0.12, -0.1), (0.3, 0.12), (0.42, -0.08), (0.5, 0.1)]


def integrate(xi, zmp, time):
    """xi after a time, with the ZMP as a function of it."""
    solution = solve_ivp(
        lambda t, x: OMEGA * (x - zmp(t)), (0.0, time), np.array(xi), rtol=1e-10, atol=1e-12
    )
    return solution.y[:, -1]


@pytest.mark.parametrize("beta", [0.0, 0.07])
def test_steps_from_a_touchdown_on_end_at_rest_over_the_last_foothold(beta):
    legs = LegMomentum(beta, OMEGA * math.sqrt(1.0 + 2.0 * beta))
    assert legs.omega == pytest.approx(OMEGA)
    xi = np.array(touchdown_dcm(FEET[1:], legs, TIMES))
    # At the touchdown of foot 2 the ZMP goes over to it from foot 1, while foot 0 has gone there.
    for i in range(2, len(FEET)):
        behind, ahead = FEET[i - 1], FEET[i]
        a, b = (np.array(legs.joined(p, (behind, ahead))) for p in (behind, ahead))
        D, T = TIMES.double_support, TIMES.swing
        xi = integrate(xi, lambda t, a=a, b=b, D=D: a + t / D * (b - a), D)
        if i + 1 < len(FEET):
            end = np.array(legs.joined(ahead, (ahead, FEET[i + 1])))
            xi = integrate(xi, lambda t, b=b, end=end, T=T: b + t / T * (end - b), T)
    assert xi == pytest.approx(FEET[-1], abs=1e-6)


def test_the_touchdown_moves_with_the_foothold_and_all_after_it():
    legs = LegMomentum(0.06, OMEGA)
    moved = [FEET[1], *((x + 0.1, y) for x, y in FEET[2:])]
    before, after = (touchdown_dcm(feet, legs, TIMES) for feet in (FEET[1:], moved))
    assert after[0] - before[0] == pytest.approx(0.1 * transfer_gain(legs, TIMES))
    assert after[1] == pytest.approx(before[1])


def test_the_cubic_arrives_with_the_velocity_that_is_asked_for():
    now, goal, dt = (0.1, -0.3), (0.4, 0.5), 0.002
    for k in range(150):
        now = hermite_step(now, goal, 0.3 - k * dt, dt)
    assert now == pytest.approx(goal, abs=1e-6)
