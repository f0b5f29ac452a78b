"""The robots of the catalog, in Pinocchio and in MuJoCo: one document, two independent models."""

import numpy as np
import pytest

from poise.errors import MissingExtraError
from poise.robots import load_robot
from poise.sim import Plant, PlantConfig

STANDING = ("humanoid33", "biped20", "g1", "talos", "romeo", "human", "simple_humanoid")


def load(name):
    try:
        return load_robot(name)
    except MissingExtraError as error:
        pytest.skip(str(error))


def vertical_force(plant):
    return sum(
        plant.data.site(name).xmat.reshape(3, 3)[2] @ wrench[:3]
        for name, wrench in plant.sole_wrenches().items()
    )


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("name", STANDING)
def test_each_stands_on_its_soles_under_a_stiff_servo(name):
    robot = load(name)
    plant = Plant(robot, PlantConfig(actuation="position"))
    lift = []
    while plant.time < 1.0:
        plant.step(None)
        lift.append(vertical_force(plant))
    assert not plant.fallen
    assert not plant.warnings
    assert plant.contacts() == dict.fromkeys(robot.soles, True)
    soles = {plant.model.geom(f"{n}_contact").id for n in robot.soles}
    touching = {int(g) for c in plant.data.contact for g in c.geom} - {0}
    ground = plant.model.geom("floor").id
    assert touching | {ground} == soles | {ground}
    # A foot on a weak ankle may chatter: what counts is the mean.
    assert np.mean(lift[-400:]) == pytest.approx(robot.mass * 9.81, rel=0.02)
