"""`LevelRows`: the rows of all levels of one state, stacked."""

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64


@dataclass(slots=True, eq=False)
class LevelRows:
    """Rows J_i dv + Jdot_i v = xdd_i,ref, the physics first, then level by level.

    Attributes:
        jacobian: J_i, stacked.
        drift: Jdot_i v, stacked.
        reference: xdd_i,ref, stacked.
        scale: what a row is multiplied by where ranks are decided: its weight over the mobility
            sqrt(J M^-1 J^T) that its block of rows has in the home posture.
        slices: rows of each level.
        firm: number of leading levels that no `DemandLimit` touches: the physics, and joints that
            are held.
    """

    jacobian: Float64[np.ndarray, "t nv"]
    drift: Float64[np.ndarray, " t"]
    reference: Float64[np.ndarray, " t"]
    scale: Float64[np.ndarray, " t"]
    slices: list[slice]
    firm: int = 1

    @staticmethod
    def allocate(sizes: list[int], nv: int) -> "LevelRows":
        """Zero rows.

        Args:
            sizes: number of rows of each level.
            nv: number of generalized coordinates.
        """
        ends = np.cumsum([0, *sizes]).tolist()
        return LevelRows(
            jacobian=np.zeros((ends[-1], nv)),
            drift=np.zeros(ends[-1]),
            reference=np.zeros(ends[-1]),
            scale=np.ones(ends[-1]),
            slices=[slice(a, b) for a, b in itertools.pairwise(ends)],
        )

    def scaled(self) -> tuple[Float64[np.ndarray, "t nv"], Float64[np.ndarray, " t"]]:
        """Rows and their right-hand sides xdd_i,ref - Jdot_i v, both times `scale`."""
        return self.jacobian * self.scale[:, None], (self.reference - self.drift) * self.scale

    def with_joints(
        self,
        index: Int64[np.ndarray, " k"],
        acceleration: Float64[np.ndarray, " k"],
        scale: Float64[np.ndarray, " k"],
    ) -> "LevelRows":
        """The same rows with given joint accelerations as one more level behind the physics.

        Args:
            index: joints in `v`.
            acceleration: theirs [rad/s^2].
            scale: their rows' scale.
        """
        first, count = self.slices[0].stop, len(index)
        selection = np.zeros((count, self.jacobian.shape[1]))
        selection[np.arange(count), index] = 1.0
        moved = [slice(s.start + count, s.stop + count) for s in self.slices[1:]]
        return LevelRows(
            jacobian=_insert(self.jacobian, selection, first),
            drift=_insert(self.drift, np.zeros(count), first),
            reference=_insert(self.reference, acceleration, first),
            scale=_insert(self.scale, scale, first),
            slices=[self.slices[0], slice(first, first + count), *moved],
            firm=2,
        )


def _insert(old: np.ndarray, new: np.ndarray, at: int) -> np.ndarray:
    return np.concatenate((old[:at], new, old[at:]))
