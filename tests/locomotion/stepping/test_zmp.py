"""The ZMP from the soles' load cells, against where they are pressed."""

import numpy as np
import pytest
from standing import biped, estimator

from poise.dynamics import RobotState


def pressed(robot, *points):
    """A state whose soles are pressed at points of their own, each with a load [m, m, N]."""
    wrenches = {
        name: np.array([0.0, 0.0, load, y * load, -x * load, 0.0])
        for name, (x, y, load) in zip(biped(robot).soles, points, strict=True)
    }
    return RobotState(robot.q_home, np.zeros(robot.nv), wrenches)


def read(where, state):
    where.dynamics.update(state)
    return where.sense


@pytest.mark.parametrize("point", [(0.05, 0.0), (0.0, 0.03), (-0.04, 0.02)])
def test_the_zmp_is_where_the_sole_is_pressed(get_robot, point):
    robot = get_robot("biped20")
    where = estimator(robot)
    ours = read(where, pressed(robot, (*point, 600.0), (0.0, 0.0, 0.0)))
    assert ours.zmp == pytest.approx(where.sole(0)[:2] + point, abs=1e-12)
    assert ours.loads.tolist() == [600.0, 0.0]


def test_two_soles_weigh_by_their_loads(get_robot):
    robot = get_robot("biped20")
    where = estimator(robot)
    ours = read(where, pressed(robot, (0.0, 0.0, 450.0), (0.0, 0.0, 150.0)))
    between = 0.75 * where.sole(0)[:2] + 0.25 * where.sole(1)[:2]
    assert ours.zmp == pytest.approx(between, abs=1e-12)


def test_without_load_the_last_zmp_holds(get_robot):
    robot = get_robot("biped20")
    where = estimator(robot)
    ours = read(where, pressed(robot, (0.05, 0.01, 600.0), (0.0, 0.0, 0.0)))
    before = ours.zmp.copy()
    ours = read(where, pressed(robot, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    assert ours.zmp.tolist() == before.tolist()


@pytest.mark.parametrize("entry", range(6))
def test_a_wrench_with_a_hole_says_nothing_and_is_forgotten(get_robot, entry):
    robot = get_robot("biped20")
    where = estimator(robot)
    good = pressed(robot, (0.05, 0.01, 600.0), (0.0, 0.0, 0.0))
    ours = read(where, good)
    before = ours.zmp.copy()
    bad = pressed(robot, (0.05, 0.01, 600.0), (0.0, 0.0, 0.0))
    bad.contacts[biped(robot).soles[0]][entry] = np.nan
    ours = read(where, bad)
    assert ours.zmp.tolist() == before.tolist()
    assert ours.loads.tolist() == [0.0, 0.0]
    ours = read(where, good)
    np.testing.assert_allclose(ours.zmp, before, atol=1e-12)
    assert ours.loads.tolist() == [600.0, 0.0]
