"""`DemandLimit`: how hard a level may drive the joints."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.checks import checked_number

_ITERATIONS = 50
"""Far more than Newton's method takes on the secular equation: it converges from one side."""

_TOLERANCE = 1e-13
"""Relative error of the length of the step at which the search is over."""


@dataclass(frozen=True, kw_only=True)
class DemandLimit:
    """No level asks more than so much acceleration of any joint, on top of the levels above.

    A hand that is pulled beyond its reach, or held where an arm can hardly move it, asks for
    joint accelerations that grow as one over the mobility that is left. Joints would run into
    their velocity and torque limits, which stand above all tasks, and from one into the other.
    So the level's acceleration z, in the mass metric, becomes the solution of

        min |A z - c|^2 + lambda |z|^2      with the least lambda >= 0 for which |z| <= Z

    where Z is the length at which the undamped solution's fastest joint would reach `acceleration`:
    weak directions give way first, strong ones hardly. What a level cannot have in a direction is
    not given to the levels below. Levels that ask for less are not touched.

    Attributes:
        acceleration: largest acceleration that a level asks of a joint [rad/s^2].
        base: number of coordinates before the joints, which may accelerate as they like.
    """

    acceleration: float = 50.0
    base: int = 0

    def __post_init__(self) -> None:
        checked_number(
            self.acceleration, "largest acceleration of the demand limit [rad/s^2]", above=0.0
        )

    def is_kept(self, acceleration: Float64[np.ndarray, "*k n"]) -> bool:
        """Whether accelerations of one level, or of several, ask no more than is allowed."""
        joints = acceleration[..., self.base :]
        return max(float(joints.max()), -float(joints.min())) <= self.acceleration

    def tempered(
        self,
        share: Float64[np.ndarray, " d"],
        gain: Float64[np.ndarray, " d"],
        pull: Float64[np.ndarray, " d"],
        motion: Float64[np.ndarray, "n d"],
    ) -> Float64[np.ndarray, " d"]:
        """The gains of one level's directions, damped as far as the limit asks.

        Args:
            share: shares of the directions, from `RankTreatment.shares`.
            gain: their inverses.
            pull: A^T c along the directions; gain times pull is z.
            motion: acceleration of the robot for a unit of each direction.
        """
        step = gain * pull
        acceleration = motion.dot(step)
        if self.is_kept(acceleration):
            return gain
        joints = acceleration[self.base :]
        length = float(np.linalg.norm(step)) * self.acceleration / float(np.abs(joints).max())
        taken = share > 0.0
        stiffness = np.divide(share, gain, out=np.ones_like(gain), where=taken)
        damping = _damping(np.where(taken, share * pull, 0.0), stiffness, length)
        return share / (stiffness + damping)


def _damping(
    pull: Float64[np.ndarray, " d"], stiffness: Float64[np.ndarray, " d"], length: float
) -> float:
    """The lambda > 0 for which pull / (stiffness + lambda) has a length."""
    damping = 0.0
    for _ in range(_ITERATIONS):
        damped = stiffness + damping
        step = pull / damped
        norm = float(np.linalg.norm(step))
        if norm - length <= _TOLERANCE * length:
            break
        # Newton on one over the length, which is nearly straight.
        damping += (norm - length) / length * norm * norm / float(np.sum(step * step / damped))
    return damping
