"""The last step: both feet hold the robot wherever it is between them."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from poise.locomotion._walking._step_planner import LastStep

HERE, NOWHERE = (0.0, 0.0), (0.0, 0.0)


def placed(low, high):
    return st.tuples(*(st.floats(*ends) for ends in zip(low, high, strict=True)))


@given(placed((-0.3, 0.05), (0.3, 0.3)), placed((-0.3, -0.1), (0.3, 0.4)), st.floats(0.0, 0.1))
def test_the_foothold_moves_until_both_feet_hold_the_robot(foothold, xi, beta):
    last = LastStep(beta, (0.02, 0.01))
    x, y = last.move(xi, foothold, HERE)
    assert math.hypot(*last.off(xi, (foothold[0] + x, foothold[1] + y), HERE)) < 1e-9


def test_the_foothold_moves_the_least_way():
    """Against all places on a grid from which what is looked at between the feet holds it."""
    last, foothold, xi = LastStep(0.05, (0.05, 0.02)), (0.35, 0.23), (-0.01, 0.16)
    by = math.hypot(*last.move(xi, foothold, HERE))
    grid = np.arange(-0.4, 0.4, 0.01)
    held = [
        math.hypot(x, y)
        for x in grid
        for y in grid
        if last.off(xi, (foothold[0] + x, foothold[1] + y), HERE) == NOWHERE
    ]
    assert by == pytest.approx(min(held), abs=0.015)
    # To the side of it, and not farther out along the line.
    assert last.move(xi, foothold, HERE)[0] < -0.1
