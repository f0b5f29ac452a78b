"""`TrunkLean`: the trunk leans over a foot whose hip is too weak to hold the body upright on it.

`TrunkPose`: how pelvis and torso shall be turned: so, facing as the feet do, and as commanded.
"""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.locomotion._stepping._stance._footing import Footing, turn_to_left, wrapped

_RATE = 0.3
"""How fast it leans over a foot, and back [rad/s]."""

_TURN_RATE, _POSE_RATE = 0.5, 0.6
"""How fast the trunk turns to where the feet face, and to what is commanded [rad/s]."""

TORSO_MOST = (0.3, 0.4, 0.5)
"""Roll, pitch and yaw of the torso that can be commanded: what most waists do [rad]."""

UPRIGHT = (0.0, 0.0, 0.0)
LEVEL = np.eye(3)


class TrunkLean:
    """Upright, or leaning over the foot that carries where its hip needs that."""

    def __init__(self, relief: tuple[float, float], dt: float) -> None:
        self._goals = (-relief[0], relief[1])
        self._step = _RATE * dt
        self._angle = 0.0

    def reset(self) -> None:
        """Upright."""
        self._angle = 0.0

    def rotation(self, footing: Footing) -> Float64[np.ndarray, "3 3"]:
        """Return world_R_trunk of this tick."""
        carries = footing.mode.support
        goal = 0.0 if carries is None else self._goals[carries]
        self._angle += max(-self._step, min(self._step, goal - self._angle))
        if self._angle == 0.0:
            return LEVEL
        x, y = footing.heading.tolist()
        return pin.exp3(self._angle * np.array([x, y, 0.0]))


class TrunkPose:
    """References of pelvis and torso, where both can be turned."""

    def __init__(
        self, relief: tuple[float, float], dt: float, waist: Float64[np.ndarray, "3 2"]
    ) -> None:
        self._lean, self._dt = TrunkLean(relief, dt), dt
        self._waist: list[list[float]] = waist.tolist()
        self.reset()

    def reset(self) -> None:
        """Upright, facing as the feet do."""
        self._lean.reset()
        self._facing: float | None = None
        self._torso = UPRIGHT

    @property
    def upright(self) -> bool:
        """Whether the torso is in line with the pelvis, and nobody asks for anything else."""
        return self._torso == UPRIGHT

    def rotations(
        self, footing: Footing, facing: float, torso: tuple[float, float, float]
    ) -> tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, "3 3"]]:
        """World_R_pelvis and world_R_torso in this tick."""
        before = facing if self._facing is None else self._facing
        most = _TURN_RATE * self._dt
        # The shorter way, also where angles pass from pi to -pi.
        turn = wrapped(facing - before)
        self._facing = before + max(-most, min(most, turn))
        if torso != self._torso:
            self._torso = self._moved(torso)
        pelvis = self._lean.rotation(footing)
        if self._facing != 0.0:
            turn = turn_to_left(self._facing)
            pelvis = turn if pelvis is LEVEL else pelvis.dot(turn)
        if self.upright:
            return pelvis, pelvis
        turned = pelvis @ pin.rpy.rpyToMatrix(np.array(self._torso))
        pairs = zip(self._torso, self._waist, strict=True)
        bent = tuple(max(least, min(most, angle)) for angle, (least, most) in pairs)
        if bent != self._torso:
            # What the waist cannot do the pelvis does: asked to stay upright beneath a torso that
            # is asked to bend, both would go half the way.
            pelvis = turned @ pin.rpy.rpyToMatrix(np.array(bent)).T
        return pelvis, turned

    def _moved(self, torso: tuple[float, float, float]) -> tuple[float, float, float]:
        """Roll, pitch and yaw of the torso, rate-limited towards what is commanded [rad]."""
        most = _POSE_RATE * self._dt
        roll, pitch, yaw = (
            before + max(-most, min(most, max(-largest, min(largest, angle)) - before))
            for before, angle, largest in zip(self._torso, torso, TORSO_MOST, strict=True)
        )
        return roll, pitch, yaw
