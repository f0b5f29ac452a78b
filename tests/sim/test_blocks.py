"""Which blocks the robot touches and how near to them it is."""

import mujoco
import numpy as np
import pytest

from poise.robots import load_robot
from poise.sim import Block, BlockWatch, Plant, PlantConfig

FAR = 0.2


@pytest.fixture(scope="module")
def plant():
    random = np.random.default_rng(3)
    blocks = tuple(
        Block(
            center=tuple(random.uniform(-0.6, 0.6, 2).tolist()),
            size=tuple(random.uniform(0.02, 0.3, 3).tolist()),
            tilt=tuple(random.uniform(-0.3, 0.3, 2).tolist()),
            top=float(random.uniform(0.0, 1.2)),
            told=False,
            yaw=float(random.uniform(-3.0, 3.0)),
        )
        for _ in range(12)
    )
    return Plant(load_robot("g1"), PlantConfig(blocks=blocks))


def test_the_nearest_block_is_found_without_measuring_every_pair(plant):
    model, data, random = plant.model, plant.data, np.random.default_rng(4)
    watch, seen = BlockWatch(plant, distance_max=FAR), []
    blocks = [g for g in range(model.ngeom) if model.geom(g).name.startswith("block")]
    limbs = np.flatnonzero((model.geom_bodyid > 0) & (model.geom_conaffinity > 0)).tolist()
    for _ in range(30):
        data.qpos[:3] = random.uniform(-1.5, 1.5, 3)
        data.qpos[7:] = random.uniform(-0.5, 0.5, model.nq - 7)
        mujoco.mj_kinematics(model, data)
        least = min(
            mujoco.mj_geomDistance(model, data, block, limb, FAR, None)
            for block in blocks
            for limb in limbs
        )
        seen.append(watch.clearance())
        assert seen[-1] == pytest.approx(least, abs=1e-9)
    # Some are inside, some between, and some too far.
    assert min(seen) < 0.0
    assert max(seen) == FAR
    assert any(0.0 < distance < FAR for distance in seen)
