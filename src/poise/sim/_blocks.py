"""Which blocks the robot touches, and how near to them it came."""

import math

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.sim._build import FLOOR_ONLY
from poise.sim._plant import Plant


class BlockWatch:
    """Touch of a plant's blocks and the distance from them."""

    def __init__(self, plant: Plant, *, distance_max: float = 0.2) -> None:
        self._plant, self._far = plant, distance_max
        model = plant.model
        blocks = [int(model.geom(f"block{i}").id) for i in range(len(plant.config.blocks))]
        solid = (model.geom_conaffinity & FLOOR_ONLY["conaffinity"]) != 0
        self._blocks, self._touching = np.array(blocks, dtype=np.int64), set(blocks)
        self._limbs = np.flatnonzero(solid & (model.geom_bodyid > 0))
        self._radii = model.geom_rbound[self._limbs]
        # Blocks stay where they are.
        self._centers = plant.data.geom_xpos[self._blocks]
        self._axes = plant.data.geom_xmat[self._blocks].reshape(-1, 3, 3)
        self._halves = model.geom_size[self._blocks, None]
        up = (np.abs(self._axes[:, 2:]) @ model.geom_size[self._blocks, :, None]).ravel()
        self._top = float((self._centers[:, 2] + up).max(initial=-math.inf))

    def touched(self) -> bool:
        """Whether any solid part of the robot touches a block at the last physics step."""
        return not self._touching.isdisjoint(self._plant.data.contact.geom.ravel().tolist())

    def clearance(self) -> float:
        """Distance of the robot's solid parts from the blocks, at most `distance_max` [m]."""
        model, data, nearest = self._plant.model, self._plant.data, self._far
        places = data.geom_xpos[self._limbs]
        # Most of a robot is far above all blocks.
        low = np.flatnonzero(places[:, 2] - self._radii < self._top + nearest)
        least = self._least_distances(places[low], self._radii[low])
        # Exact distances are dear, and most pairs are farther apart than the nearest is.
        near = np.flatnonzero(least < nearest)
        for i in near[np.argsort(least[near])].tolist():
            if least[i] >= nearest:
                break
            block, limb = divmod(i, len(low))
            pair = int(self._blocks[block]), int(self._limbs[low[limb]])
            nearest = min(nearest, mujoco.mj_geomDistance(model, data, *pair, nearest, None))
        return float(nearest)

    def _least_distances(
        self, places: Float64[np.ndarray, "limbs 3"], radii: Float64[np.ndarray, " limbs"]
    ) -> Float64[np.ndarray, " pairs"]:
        """Distances of spheres around the limbs from the blocks, all limbs of the first first."""
        # Along the axes of each box, and beyond its sides.
        beyond = np.abs((places - self._centers[:, None]) @ self._axes) - self._halves
        distance = np.sqrt((np.maximum(beyond, 0.0) ** 2).sum(axis=-1))
        return (distance - radii).ravel()
