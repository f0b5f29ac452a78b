"""`ground_heights`: how high the floor and the blocks of a plant are under points."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.sim import PlantConfig


def ground_heights(
    config: PlantConfig, points: Float64[np.ndarray, "n 2"]
) -> Float64[np.ndarray, " n"]:
    """Height of the floor in the world, or of a block's top that is above it, under points."""
    floor = pin.SE3(pin.exp3(np.array([*config.floor_slope, 0.0])), np.zeros(3))
    heights = _plane_heights(floor, points)
    for block in config.blocks:
        length, width, height = block.size
        top = block.pose * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5 * height]))
        own = _plane_heights(top, points)
        local = (np.column_stack([points, own]) - top.translation) @ top.rotation
        over = (np.abs(local[:, :2]) <= 0.5 * np.array([length, width])).all(axis=1)
        heights = np.where(over, np.maximum(heights, own), heights)
    return heights


def _plane_heights(plane: pin.SE3, points: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, " n"]:
    """Heights of the xy plane of a pose over points of the world."""
    normal = plane.rotation[:, 2]
    return plane.translation[2] - (points - plane.translation[:2]) @ normal[:2] / normal[2]
