"""Nobody commands anything: robots stand on slopes, and where the attitude is measured wrongly."""

import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, run_teleop
from poise.locomotion import ScriptedDevice

SLOPE, ERROR = math.radians(2.0), math.radians(1.0)
AHEAD, BACK, ASIDE = (0.0, 1.0), (0.0, -1.0), (1.0, 0.0)
"""Directions of a turn: about the world's x and y axes."""


def stand(robot, duration=4.0, **changes):
    return run_teleop(
        robot,
        lambda teleoperator: ScriptedDevice([], *teleoperator.estimator.anchors),
        replace(VELOCITY_TELEOP_PLANT, **changes),
        duration=duration,
    )


def at_rest(run):
    return not run.fell and np.ptp(run.log.zmp[-100:], axis=0).max() < 0.01


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("way", [AHEAD, BACK, ASIDE])
@pytest.mark.parametrize("robot", ["biped20", "humanoid33", "g1"])
def test_it_comes_to_rest_on_a_slope_though_it_begins_on_the_edges_of_its_soles(
    get_robot, robot, way
):
    run = stand(get_robot(robot), floor_slope=(SLOPE * way[0], SLOPE * way[1]))
    assert at_rest(run)
    # Both soles lie flat and carry, and no leg pushes against the other.
    assert run.log.loads[-1].min() > 0.35 * run.plant.robot.weight
    assert np.linalg.norm(run.log.zmp[-1] - run.log.zmp_reference[-1]) < 0.01


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("way", [AHEAD, BACK, ASIDE])
@pytest.mark.parametrize("robot", ["biped20", "g1"])
def test_it_stands_with_an_attitude_that_is_off_by_a_degree(get_robot, robot, way):
    error = (ERROR * way[0], ERROR * way[1])
    sensors = replace(VELOCITY_TELEOP_PLANT.sensors, base_orientation_error=error)
    assert at_rest(stand(get_robot(robot), duration=3.0, sensors=sensors))
