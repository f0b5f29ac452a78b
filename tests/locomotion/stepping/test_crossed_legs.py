"""An operator who crosses the legs, where velocities are commanded and links touch each other."""

from dataclasses import replace

import pytest
from walker import hands

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, BadOperator, run_teleop
from poise.locomotion import WayPoint
from poise.sim import Plant

SEED = 21001
"""Of a bad operator under whom the feet of `biped20` met with 900 N, and it fell, after 2.3 s."""


def crossing(foot):
    """Lifts a foot, throws it far across the other one and puts it down there."""
    across = {"left": -0.4, "right": 0.4}[foot]
    places = ((0.1, 0.0, 0.0), (0.2, 0.0, 0.03), (0.8, 0.0, 0.06), (1.0, across, 0.06),
              (1.8, across, 0.06), (2.4, across, -0.04), (3.8, across, 0.0))  # fmt: skip
    return hands(*(WayPoint(at=at, **{foot: (0.0, y, z)}) for at, y, z in places))


@pytest.fixture
def touched(monkeypatch):
    """Runs a robot, and says whether it fell and the largest force of one link on another [N]."""
    forces, step = [0.0], Plant.step

    def watched(self, *args):
        step(self, *args)
        forces.extend(self.self_contacts.values())

    def run(robot, device, plant, **settings):
        forces[:] = [0.0]
        return run_teleop(robot, device, plant, **settings).fell, max(forces)

    monkeypatch.setattr(Plant, "step", watched)
    return run


def touching(error=(0.0087, 0.0)):
    plant = replace(VELOCITY_TELEOP_PLANT.with_noise(), self_contact=True)
    # An attitude that is off by half a degree has feet where they are not taken to be.
    return replace(plant, sensors=replace(plant.sensors, base_orientation_error=error))


def cross(touched, robot, foot):
    return touched(robot, crossing(foot), touching(), duration=3.4)


def lead_badly(touched, robot):
    plant = touching((-0.004091, 0.007708))
    return touched(robot, lambda t: BadOperator(t, SEED), plant, duration=3.2, seed=SEED)


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("foot", ["left", "right"])
@pytest.mark.parametrize("name", ["biped20", "g1"])
def test_legs_that_are_crossed_do_not_touch(get_robot, touched, name, foot):
    fell, force = cross(touched, get_robot(name), foot)
    assert not fell
    assert force == 0.0


def test_under_a_bad_operator_feet_do_not_touch(get_robot, touched):
    fell, force = lead_badly(touched, get_robot("biped20"))
    assert not fell
    assert force == 0.0
