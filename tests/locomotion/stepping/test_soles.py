"""How the ground is known under a sole, and how a foot gives way to what squeezes it."""

import math

import numpy as np
import pytest
from standing import PARAMETERS, footing, sensed

from poise.dynamics import RobotState
from poise.locomotion import Mode
from poise.locomotion._stepping._velocity_tasks import (
    SoleGrounds,
    yielding_turn,
    yielding_velocity,
)

TICKS, DT = 400, PARAMETERS.dt
TILT = 0.02
SOLE = (0.30, 0.24)
"""Length and width of a sole of biped20 [m]."""


def pressed(left, right, loads=(320.0, 320.0)):
    """What soles measure that are pressed at points of their own [m]."""
    ours = sensed(*loads)
    ours.centres[:] = left, right
    return ours


def tilted(robot, angle, ours, mode=Mode.D):
    """A footing whose robot is turned about the y axis, nose down [rad]."""
    stands = footing(robot, mode, loaded=ours)
    q = robot.q_home.copy()
    q[3:7] = 0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)
    stands.dynamics.update(RobotState(q, np.zeros(robot.nv)))
    return stands


def pitch(grounds, foot):
    forward = grounds.rotation(foot)[:, 0]
    return math.atan2(-forward[2], forward[0])


def test_a_sole_that_lies_flat_says_how_its_ground_is_tilted(get_robot):
    robot = get_robot("biped20")
    grounds, ours = SoleGrounds(PARAMETERS.dt), pressed((0.01, 0.0), (0.0, -0.01))
    stands = tilted(robot, TILT, ours)
    for _ in range(TICKS):
        grounds.update(stands)
    for foot in (0, 1):
        assert pitch(grounds, foot) == pytest.approx(TILT, abs=1e-6)
        assert not grounds.seeking(stands, foot).any()
    # So an inertial unit that is off by as much turns no sole.
    np.testing.assert_allclose(grounds.righting(stands, 0, 8.0), 0.0, atol=1e-6)


@pytest.mark.parametrize(("toe", "known"), [(0.149, 0.0), (-0.149, TILT)])
def test_a_sole_on_its_edge_is_tilted_only_towards_that_edge(get_robot, toe, known):
    robot = get_robot("biped20")
    grounds, flat = SoleGrounds(PARAMETERS.dt), pressed((0.0, 0.0), (0.0, 0.0))
    upright = tilted(robot, 0.0, flat)
    for _ in range(TICKS):
        grounds.update(upright)
    edge = tilted(robot, TILT, pressed((toe, 0.0), (toe, 0.0)))
    for _ in range(TICKS):
        grounds.update(edge)
    # On its toes the sole has left its ground; on its heel the ground has to be so.
    assert pitch(grounds, 0) == pytest.approx(known, abs=1e-6)
    back = grounds.righting(edge, 0, 8.0)[1]
    assert back == pytest.approx(8.0 * (known - TILT), abs=1e-5)


@pytest.mark.parametrize(
    ("point", "turn"),
    [((-0.149, 0.0), (0.0, 0.5)), ((0.149, 0.0), (0.0, -0.5)), ((0.0, 0.119), (0.5, 0.0))],
)
def test_a_sole_that_has_not_lain_flat_yet_turns_its_free_edge_down(get_robot, point, turn):
    robot = get_robot("biped20")
    grounds, ours = SoleGrounds(PARAMETERS.dt), pressed(point, point)
    stands = tilted(robot, 0.0, ours)
    grounds.update(stands)
    assert grounds.seeking(stands, 0)[:2] == pytest.approx(turn)
    inside = tilted(robot, 0.0, pressed((0.0, 0.0), (0.0, 0.0)))
    grounds.update(inside)
    assert not grounds.seeking(stands, 0).any()


def test_the_ground_of_a_foot_in_the_air_is_the_stances_and_is_forgotten(get_robot):
    robot = get_robot("biped20")
    grounds, both = SoleGrounds(PARAMETERS.dt), pressed((0.0, 0.0), (0.0, 0.0))
    grounds.update(tilted(robot, 0.0, both))
    alone = tilted(robot, TILT, pressed((0.0, 0.0), None, (640.0, 0.0)), Mode.SL)
    for _ in range(TICKS):
        grounds.update(alone)
    np.testing.assert_array_equal(grounds.rotation(1), grounds.rotation(0))
    assert pitch(grounds, 1) == pytest.approx(TILT, abs=1e-6)
    landed = pressed((0.0, 0.0), (0.149, 0.0))
    grounds.update(tilted(robot, TILT, landed))
    assert grounds.seeking(tilted(robot, TILT, landed), 1)[1] < 0.0


def test_the_other_sole_turns_until_it_is_pressed_as_far_ahead_as_the_stance(get_robot):
    robot = get_robot("biped20")
    ahead = footing(robot, Mode.D, loaded=pressed((0.02, 0.0), (0.05, 0.0)))
    roll, turn = yielding_turn(ahead)
    # Pressed further ahead at its toes, it turns them up.
    assert (roll, turn) == (pytest.approx(0.0, abs=1e-12), pytest.approx(-0.3 * 0.03))
    alike = footing(robot, Mode.D, loaded=pressed((0.04, 0.03), (0.04, 0.0)))
    assert yielding_turn(alike) == pytest.approx([0.0, 0.0], abs=1e-12)
    aside = footing(robot, Mode.D, loaded=pressed((0.0, 0.03), (0.0, 0.03)))
    # Sideways the loads hold the balance: there it is the middle, whatever the stance has.
    assert yielding_turn(aside)[0] == pytest.approx(0.3 * 0.03)
    assert yielding_turn(footing(robot, Mode.D)) is None


def test_a_foot_gives_way_to_what_squeezes_and_to_nothing_else(get_robot):
    robot = get_robot("biped20")
    hold = np.array([0.1, 0.2, 0.3])
    ours = pressed((0.0, 0.0), (0.0, 0.0))
    ours.wrenches[:] = (0.0, -50.0), (0.0, 50.0)
    stands = footing(robot, Mode.D, loaded=ours)
    middle = stands.zmp_reference
    # Where the ZMP is measured does not matter: joints that sag leave the weight where it was.
    ours.zmp = stands.sole(0)[:2].copy()
    stands.anchors[1][1] -= 0.01
    x, y, z = yielding_velocity(stands, hold, middle, DT)
    weight = robot.weight
    assert (x, z) == (pytest.approx(0.0, abs=1e-9), pytest.approx(0.0, abs=1e-9))
    assert y == pytest.approx(0.15 * 50.0 / weight)
    # It stands where it is: what it was held at goes there.
    assert -0.01 < stands.anchors[1][1] - stands.sole(1)[1] < 0.0
    ours.wrenches[:] = (40.0, 30.0), (40.0, 30.0)
    assert yielding_velocity(stands, hold, middle, DT) == pytest.approx(np.zeros(3), abs=1e-9)
    ours.loads[:] = 400.0, 240.0
    # It carries less than the ZMP in the middle says: down.
    assert yielding_velocity(stands, np.zeros(3), middle, DT)[2] < 0.0
    # Nor is it to carry anything with the ZMP in the other foot: up.
    assert yielding_velocity(stands, np.zeros(3), stands.sole(0)[:2], DT)[2] > 0.0
    ours.centres[1] = None
    np.testing.assert_array_equal(yielding_velocity(stands, hold, middle, DT), hold)
