"""Soles that stand, carry little and are far off level are turned back."""

from unittest.mock import Mock

import numpy as np
import pinocchio as pin
import pytest

from poise.locomotion._stepping._by_torque._departures import SoleRighting
from poise.locomotion._stepping._stance._footing import Footing
from poise.stack import SurfaceContact

WEIGHT, DT = 300.0, 0.002


@pytest.fixture
def contacts(get_robot):
    robot = get_robot("biped20")
    made = [SurfaceContact(sole) for sole in robot.soles]
    for contact in made:
        contact.bind(robot)
    return made


def look(righting, rotations, loads):
    """A tick with the soles turned like that, which carry such parts of the weight."""
    footing = Mock(spec=Footing)
    footing.sense = Mock(loads=WEIGHT * np.array(loads))
    footing.soles = [(np.zeros(3), rotation) for rotation in rotations]
    righting.update(footing)


@pytest.mark.parametrize("turned", [(0.4, 0.0, 0.3), (-0.3, 0.2, -1.0), (0.1, -0.5, 2.0)])
def test_a_sole_without_load_comes_nearly_level_and_keeps_its_heading(contacts, turned):
    """As the contact asks its foot to move, damping included; the left one lies."""
    righting = SoleRighting(contacts, WEIGHT)
    start = rotation = pin.rpy.rpyToMatrix(np.array(turned))
    rate = np.zeros(3)
    for _ in range(400):
        look(righting, (np.eye(3), rotation), (1.0, 0.0))
        asks = contacts[1].acceleration
        assert asks[[0, 1, 2, 5]] == pytest.approx(0.0)
        rate = rate + DT * (asks[3:] - contacts[1].damping * rate)
        rotation = rotation @ pin.exp3(DT * rate)
    # So far its ground may slope; it comes to rest not far within.
    left = np.linalg.norm(rotation[2, :2])
    assert 0.01 < left < 0.1
    assert np.linalg.norm(rate) < 0.01
    # By the shortest way: as if its upward axis had been taken towards the vertical at once.
    axis = np.cross(start[:, 2], (0.0, 0.0, 1.0))
    sine = np.linalg.norm(axis)
    shortest = pin.exp3(axis / sine * (np.arcsin(sine) - np.arcsin(left))) @ start
    assert np.linalg.norm(pin.log3(shortest.T @ rotation)) < 0.03
    np.testing.assert_array_equal(contacts[0].acceleration, np.zeros(6))


@pytest.mark.parametrize("slope", [(0.069, 0.0), (-0.05, 0.06)])
def test_a_sole_without_load_may_lie_as_a_slope_does(contacts, slope):
    """4 degrees: the floor's, and what the attitude is off by."""
    turned = pin.rpy.rpyToMatrix(np.array([*slope, 0.7]))
    look(SoleRighting(contacts, WEIGHT), (turned, np.eye(3)), (0.0, 1.0))
    assert not contacts[0].acceleration.any()


def test_what_carries_lies_as_its_ground_does(contacts):
    righting = SoleRighting(contacts, WEIGHT)
    tilted = pin.rpy.rpyToMatrix(np.array([0.1, 0.2, 0.0]))
    asked = []
    for load in (0.0, 0.1, 0.15, 0.2, 0.5):
        look(righting, (tilted, np.eye(3)), (load, 1.0 - load))
        asked.append(float(np.linalg.norm(contacts[0].acceleration)))
    assert asked[0] == asked[1] > asked[2] > asked[3] == asked[4] == 0.0


def test_no_more_is_asked_for_than_an_ankle_may_do(contacts):
    look(
        SoleRighting(contacts, WEIGHT),
        (pin.rpy.rpyToMatrix(np.array([1.2, 0.7, 0.0])), np.eye(3)),
        (0.0, 1.0),
    )
    assert np.abs(contacts[0].acceleration).max() == pytest.approx(60.0)


def test_a_foot_in_the_air_is_somebody_elses(contacts):
    righting = SoleRighting(contacts, WEIGHT)
    tilted = pin.rpy.rpyToMatrix(np.array([0.3, 0.0, 0.0]))
    look(righting, (tilted, np.eye(3)), (0.0, 1.0))
    assert contacts[0].acceleration.any()
    contacts[0].release(0.0)
    contacts[0].advance(0.0)
    look(righting, (tilted, np.eye(3)), (0.0, 1.0))
    assert not contacts[0].acceleration.any()
    contacts[0].engage(0.0)
    contacts[0].advance(0.1)
    look(righting, (tilted, np.eye(3)), (0.0, 1.0))
    righting.reset()
    assert not contacts[0].acceleration.any()
