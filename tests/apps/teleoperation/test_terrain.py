"""Grounds by name: what lies where, and that a recording keeps it."""

import json
from dataclasses import asdict, replace
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("mujoco")

from poise.apps.teleoperation import (
    SCRIPTS,
    VELOCITY_TELEOP_PLANT,
    plant_from_json,
    replay_teleop,
    run_teleop,
    terrain_blocks,
)
from poise.apps.teleoperation._scripts import TERRAINS
from poise.locomotion import ScriptedDevice
from poise.sim import Block


def corners(block):
    c, s = np.cos(block.yaw), np.sin(block.yaw)
    half = 0.5 * np.array(block.size[:2])
    local = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * half
    return local @ np.array([(c, s), (-s, c)]) + block.center


def overlap(first, second):
    """Whether two rectangles, as corners, overlap: no side of either separates them."""
    for rectangle in (first, second):
        for side in np.roll(rectangle, -1, axis=0) - rectangle:
            normal = np.array([-side[1], side[0]])
            a, b = first @ normal, second @ normal
            if a.max() < b.min() or b.max() < a.min():
                return False
    return True


def soles(robot, place=(0.0, 0.0)):
    """Footprints of the soles at home."""
    import pinocchio as pin

    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.q_home)
    for name, sole in list(robot.soles.items())[:2]:
        half = 0.5 * np.array([sole.length, sole.width])
        middle = data.oMf[robot.frame_id(name)].translation[:2] + place
        yield np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * half + middle


def test_flat_has_nothing_and_the_obstacle_is_that_of_scenario_1(get_robot):
    robot = get_robot("biped20")
    assert terrain_blocks("flat", robot) == ()
    assert terrain_blocks("obstacle", robot) == SCRIPTS["over_an_obstacle"](robot).blocks


@pytest.mark.parametrize("name", ["biped20", "g1"])
@pytest.mark.parametrize("terrain", TERRAINS)
@pytest.mark.parametrize("seed", [0, 1])
def test_nothing_lies_under_the_feet_at_the_start(get_robot, name, terrain, seed):
    robot = get_robot(name)
    blocks = terrain_blocks(terrain, robot, seed=seed)
    assert not any(overlap(corners(b), sole) for b in blocks for sole in soles(robot))


@pytest.mark.parametrize("name", ["biped20", "g1"])
def test_stairs_are_low_deeper_than_a_sole_and_without_gaps(get_robot, name):
    robot = get_robot(name)
    size = 1.0 if name == "biped20" else 0.8796
    blocks = terrain_blocks("steps", robot)
    length = max(sole.length for sole in robot.soles.values())
    heights = [0.0, *(b.size[2] for b in blocks), 0.0]
    assert len(blocks) == 3
    assert np.abs(np.diff(heights)).max() == pytest.approx(0.05 * size, rel=1e-3)
    for block, following in pairwise(blocks):
        assert block.size[0] > 1.2 * length
        end = block.center[0] + 0.5 * block.size[0]
        assert following.center[0] - 0.5 * following.size[0] == pytest.approx(end)


def test_bumps_are_low_ahead_too_and_the_seeds_own(get_robot):
    robot = get_robot("biped20")
    blocks = terrain_blocks("bumps", robot, seed=4)
    heights = np.array([b.size[2] for b in blocks])
    assert (heights >= 0.01 - 1e-9).all()
    assert (heights <= 0.02 + 1e-9).all()
    # Whoever walks a metre ahead meets some.
    ahead = [list(soles(robot, (x, 0.0))) for x in np.arange(0.2, 1.2, 0.1)]
    met = [any(overlap(corners(b), s) for b in blocks for s in pair) for pair in ahead]
    assert any(met)
    assert terrain_blocks("bumps", robot, seed=4) == blocks
    assert terrain_blocks("bumps", robot, seed=5) != blocks


@pytest.mark.parametrize("terrain", TERRAINS)
def test_a_plant_with_blocks_survives_a_recordings_header(get_robot, terrain):
    plant = replace(VELOCITY_TELEOP_PLANT, blocks=terrain_blocks(terrain, get_robot("g1"), seed=2))
    assert plant_from_json(json.loads(json.dumps(asdict(plant)))) == plant


def test_a_replay_has_the_terrain_of_its_recording_and_the_same_commands(get_robot, tmp_path):
    robot, path = get_robot("biped20"), tmp_path / "run.mcap"
    bumps, wall = terrain_blocks("bumps", robot, seed=1), Block(center=(0.2, -0.1), size=(0.3,) * 3)
    plant = replace(VELOCITY_TELEOP_PLANT, blocks=(*bumps, wall))
    still = lambda c: ScriptedDevice([], *c.estimator.anchors)  # noqa: E731
    run = run_teleop(robot, still, plant, duration=0.1, recording=path)
    assert run.log.touched.any()
    again = replay_teleop(path)
    assert again.plant.config.blocks == plant.blocks
    assert np.array_equal(again.log.command, run.log.command)
    assert np.array_equal(again.log.touched, run.log.touched)
