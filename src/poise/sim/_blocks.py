"""`BlockWatch`: touch of the blocks on the floor, and distance from them."""

import math

import mujoco
import numpy as np

from poise.sim._build import FLOOR_ONLY
from poise.sim._plant import Plant


class BlockWatch:
    """Touch of a plant's blocks and the distance from them."""

    def __init__(self, plant: Plant, *, distance_max: float = 0.2) -> None:
        self._plant, self._far = plant, distance_max
        model = plant.model
        blocks = [int(model.geom(f"block{i}").id) for i in range(len(plant.config.blocks))]
        solid = (model.geom_conaffinity & FLOOR_ONLY["conaffinity"]) != 0
        self._blocks, self._touching = blocks, set(blocks)
        self._limbs = np.flatnonzero(solid & (model.geom_bodyid > 0))
        self._radii = model.geom_rbound[self._limbs]
        # Blocks stay where they are.
        self._centers, self._block_radii = plant.data.geom_xpos[blocks], model.geom_rbound[blocks]
        turns = plant.data.geom_xmat[blocks].reshape(-1, 3, 3)
        up = (np.abs(turns[:, 2:]) @ model.geom_size[blocks, :, None]).ravel()
        self._top = float((self._centers[:, 2] + up).max(initial=-math.inf))

    def touched(self) -> bool:
        """True where a solid part of the robot touched a block at the last physics step."""
        return not self._touching.isdisjoint(self._plant.data.contact.geom.ravel().tolist())

    def clearance(self) -> float:
        """Distance of the robot's solid parts from the blocks, at most `distance_max` [m]."""
        model, data, nearest = self._plant.model, self._plant.data, self._far
        places = data.geom_xpos[self._limbs]
        # Most of a robot is far above all blocks, and most blocks are far from it.
        low = np.flatnonzero(places[:, 2] - self._radii < self._top + nearest)
        apart = np.linalg.norm(self._centers[:, None] - places[low], axis=2)
        least = apart - self._block_radii[:, None] - self._radii[low]
        for block, limb in np.argwhere(least < nearest).tolist():
            pair = self._blocks[block], self._limbs[low[limb]]
            nearest = min(nearest, mujoco.mj_geomDistance(model, data, *pair, nearest, None))
        return float(nearest)
