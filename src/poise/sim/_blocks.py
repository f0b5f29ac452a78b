"""Which blocks the robot touches, and how near to them it came."""

import mujoco
import numpy as np

from poise.sim._plant import Plant
from poise.sim._world import FLOOR_ONLY


class BlockWatch:
    """Looks at the blocks of a plant; made once, asked as often as wanted.

    Args:
        plant: with its blocks.
        distance_max: farther away than this nothing is measured [m].
    """

    def __init__(self, plant: Plant, *, distance_max: float = 0.2) -> None:
        self._plant, self._far = plant, distance_max
        model = plant.model
        names = [f"block{i}" for i in range(len(plant.config.blocks))]
        self._blocks = {int(model.geom(name).id) for name in names}
        _, to_ground = FLOOR_ONLY
        solid = (model.geom_conaffinity & to_ground) != 0
        self._limbs = np.flatnonzero(solid & (model.geom_bodyid > 0)).tolist()

    def touched(self) -> bool:
        """Whether any part of the robot touches a block at the last physics step."""
        return not self._blocks.isdisjoint(self._plant.data.contact.geom.ravel().tolist())

    def clearance(self) -> float:
        """Distance between the robot and the nearest block, at most `distance_max` [m]."""
        model, data, nearest = self._plant.model, self._plant.data, self._far
        for block in self._blocks:
            for limb in self._limbs:
                nearest = min(
                    nearest, mujoco.mj_geomDistance(model, data, block, limb, nearest, None)
                )
        return float(nearest)
