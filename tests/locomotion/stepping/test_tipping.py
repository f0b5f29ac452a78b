"""A sole that carries alone and turns over an edge is noticed, and one that lies is not."""

from unittest.mock import Mock

import numpy as np
import pinocchio as pin
import pytest

from poise.locomotion import Mode
from poise.locomotion._stepping._stance._footing import Footing
from poise.locomotion._stepping._stance._tipping import SoleTipping

UPRIGHT = np.eye(3)


def footing(rotation, mode=Mode.SL, stance=0):
    """Of a tick in which the stance sole is turned so."""
    made = Mock(spec=Footing, mode=mode, stance=stance)
    made.biped = Mock(frames=(7, 8))
    places = {7 + stance: (np.zeros(3), rotation), 8 - stance: (np.zeros(3), UPRIGHT)}
    made.dynamics = Mock(placement=places.get)
    return made


def turned(*vector):
    return pin.exp3(np.array(vector))


@pytest.mark.parametrize("way", [(0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-0.6, 0.8)])
@pytest.mark.parametrize("ground", [(0.0, 0.0), (0.05, -0.03)])
def test_it_has_tipped_from_a_tenth_of_a_radian_on_whatever_the_ground(way, ground):
    tipping, lies = SoleTipping(), turned(*ground, 0.3)
    assert not tipping.update(footing(lies))
    x, y = way
    assert not tipping.update(footing(lies @ turned(0.09 * x, 0.09 * y, 0.0)))
    assert tipping.update(footing(lies @ turned(0.11 * x, 0.11 * y, 0.0)))


def test_a_sole_that_turns_about_the_vertical_lies():
    tipping = SoleTipping()
    tipping.update(footing(UPRIGHT))
    assert not tipping.update(footing(turned(0.0, 0.0, 1.0)))


def test_both_feet_on_the_ground_none_carries_alone_and_the_next_one_begins_as_it_lies():
    tipping, off = SoleTipping(), turned(0.2, 0.0, 0.0)
    tipping.update(footing(UPRIGHT))
    assert not tipping.update(footing(off, mode=Mode.D))
    assert not tipping.update(footing(off))
    assert not tipping.update(footing(UPRIGHT, mode=Mode.SR, stance=1))
    tipping.reset()
    assert not tipping.update(footing(off, mode=Mode.SR, stance=1))
