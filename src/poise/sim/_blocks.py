"""Which blocks the robot touches, and how near to them it came."""

import mujoco
import numpy as np
from jaxtyping import Float64

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
        blocks = [int(model.geom(f"block{i}").id) for i in range(len(plant.config.blocks))]
        _, to_ground = FLOOR_ONLY
        solid = (model.geom_conaffinity & to_ground) != 0
        self._blocks, self._touching = np.array(blocks, dtype=np.int64), set(blocks)
        self._limbs = np.flatnonzero(solid & (model.geom_bodyid > 0))

    def touched(self) -> bool:
        """Whether any part of the robot touches a block at the last physics step."""
        return not self._touching.isdisjoint(self._plant.data.contact.geom.ravel().tolist())

    def clearance(self) -> float:
        """Distance between the robot and the nearest block, at most `distance_max` [m]."""
        model, data, nearest = self._plant.model, self._plant.data, self._far
        # Exact distances are dear, and most pairs are farther apart than the nearest is.
        least = self._least_distances()
        for i in np.flatnonzero(least < nearest)[np.argsort(least[least < nearest])].tolist():
            if least[i] >= nearest:
                break
            block, limb = divmod(i, len(self._limbs))
            nearest = min(
                nearest,
                mujoco.mj_geomDistance(
                    model, data, int(self._blocks[block]), int(self._limbs[limb]), nearest, None
                ),
            )
        return float(nearest)

    def _least_distances(self) -> Float64[np.ndarray, " pairs"]:
        """What each block is at least away from each limb, limb by limb of the first block first.

        The sphere around a limb lies that far from the box.
        """
        model, data = self._plant.model, self._plant.data
        boxes = data.geom_xmat[self._blocks].reshape(-1, 3, 3)
        apart = data.geom_xpos[self._limbs] - data.geom_xpos[self._blocks, None]
        # Along the axes of each box, and beyond its sides.
        beyond = np.abs(apart @ boxes) - model.geom_size[self._blocks, None]
        distance = np.sqrt((np.maximum(beyond, 0.0) ** 2).sum(axis=-1))
        return (distance - model.geom_rbound[self._limbs]).ravel()
