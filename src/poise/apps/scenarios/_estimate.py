"""`BaseKnowledge`: what the robot knew of its base over a run, beside where it was."""

import numpy as np
from jaxtyping import Float64

from poise.apps.report import BaseErrors
from poise.sim import RunRecord


class BaseKnowledge:
    """The base as it was estimated and as it was, over a run."""

    def __init__(self, record: RunRecord, ticks: int) -> None:
        self._ticks = ticks
        self._estimated = "base_estimate" in record
        if self._estimated:
            self._map, self._world = record["base_estimate"], record["base_truth"]
            self._speeds = record["velocity_estimate"], record["velocity_truth"]
            # SciPy takes long to import, and who only imports the package may not run anything.
            from scipy.spatial.transform import Rotation

            world, known = (Rotation.from_quat(p[:, 3:]) for p in (self._world, self._map))
            self._world_R_map = world * known.inv()

    @property
    def errors(self) -> BaseErrors | None:
        """How far off it is; None where the truth is told."""
        if not self._estimated:
            return None
        estimated, true = self._speeds
        upright = self._world_R_map.apply(np.array([0.0, 0.0, 1.0]))
        return BaseErrors(
            drift=np.linalg.norm((self._map - self._world)[:, :2], axis=1),
            tilt=np.arctan2(np.linalg.norm(upright[:, :2], axis=1), upright[:, 2]),
            speed=np.linalg.norm((estimated - true)[:, :3], axis=1),
        )

    def in_world(self, points: Float64[np.ndarray, "T k"]) -> Float64[np.ndarray, "T k"]:
        """Points of the robot's own map, where the base is as estimated, as it sees them.

        A reference that the robot follows by its estimate lies there for whoever knows the truth:
        as far from the true robot as it is, for the robot, from the estimated one.
        """
        if not self._estimated:
            return points
        known = np.zeros((self._ticks, 3))
        known[:, : points.shape[1]] = points
        turned = self._world_R_map.apply(known - self._map[:, :3]) + self._world[:, :3]
        return turned[:, : points.shape[1]]
