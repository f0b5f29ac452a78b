"""A stance sole that turns over an edge ends the operator's step, and one that lies does not.

States are made up: nothing is simulated.
"""

import math

import pytest
from made_up import MadeUp, leaning

from poise.locomotion import Mode
from poise.locomotion._walking._modes import StepEnd

ROLL, PITCH = "left_ankle_roll_joint", "left_ankle_pitch_joint"


@pytest.fixture
def on_left(get_robot):
    """Make a g1 whose right foot its operator holds up.

    The left ankle is turned by some angles before [rad].
    """

    def lift(pitch=0.0, roll=0.0):
        made = MadeUp(get_robot("g1"))
        made.q = leaning(made.robot, 0)
        made.turn(PITCH, pitch)
        made.turn(ROLL, roll)
        made.until(0.1)
        made.up = (0.0, 0.06)
        while made.mode is not Mode.SL:
            made.until(made.time + 0.01)
            assert made.time < 4.0, made.teleoperator.status.ended
        made.loads = (1.0, 0.0)
        made.until(made.time + 0.1)
        return made

    return lift


@pytest.mark.parametrize("way", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.8, -0.6)])
@pytest.mark.parametrize("ground", [(0.0, 0.0), (0.05, -0.03)])
def test_it_has_tipped_from_a_tenth_of_a_radian_on_whatever_the_ground(on_left, way, ground):
    made, (pitch, roll) = on_left(*ground), way
    made.turn(PITCH, 0.09 * pitch)
    made.turn(ROLL, 0.09 * roll)
    made.until(made.time + 0.1)
    assert made.mode is Mode.SL
    assert not made.overruled
    made.turn(PITCH, 0.02 * pitch)
    made.turn(ROLL, 0.02 * roll)
    made.until(made.time + 0.01)
    assert made.overruled
    assert made.teleoperator.status.ended is StepEnd.OVERRULED


def test_a_sole_that_turns_about_the_vertical_lies(on_left):
    made = on_left()
    made.q[3:7] = (0.0, 0.0, math.sin(0.15), math.cos(0.15))
    made.until(made.time + 0.1)
    assert made.mode is Mode.SL
    assert not made.overruled


def test_two_feet_on_the_ground_do_not_tip(get_robot):
    made = MadeUp(get_robot("g1"))
    made.until(0.1)
    made.turn(PITCH, 0.2)
    made.until(0.5)
    assert made.mode is Mode.D
    assert not made.overruled
