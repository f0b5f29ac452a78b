"""`DemandLimit`: how hard a level may drive the joints.

`truncate_levels`: lets go of tasks from the bottom up until contacts and torque limits hold.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number

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
        activation: Float64[np.ndarray, " d"],
        gain: Float64[np.ndarray, " d"],
        projection: Float64[np.ndarray, " d"],
        motion: Float64[np.ndarray, "n d"],
    ) -> Float64[np.ndarray, " d"]:
        """The gains of one level's directions, damped as far as the limit asks.

        Args:
            activation: of the directions, from `RankTreatment.activate`.
            gain: the inverses that belong to them.
            projection: A^T c along the directions; gain times projection is z.
            motion: acceleration of the robot for a unit of each direction.
        """
        step = gain * projection
        acceleration = motion.dot(step)
        if self.is_kept(acceleration):
            return gain
        joints = acceleration[self.base :]
        length = float(np.linalg.norm(step)) * self.acceleration / float(np.abs(joints).max())
        taken = activation > 0.0
        stiffness = np.divide(activation, gain, out=np.ones_like(gain), where=taken)
        damping = _damping(np.where(taken, activation * projection, 0.0), stiffness, length)
        return activation / (stiffness + damping)


def _damping(
    projection: Float64[np.ndarray, " d"], stiffness: Float64[np.ndarray, " d"], length: float
) -> float:
    """The lambda > 0 for which projection / (stiffness + lambda) has a length."""
    damping = 0.0
    for _ in range(_ITERATIONS):
        damped = stiffness + damping
        step = projection / damped
        norm = float(np.linalg.norm(step))
        if norm - length <= _TOLERANCE * length:
            break
        # Newton on one over the length, which is nearly straight.
        damping += (norm - length) / length * norm * norm / float(np.sum(step * step / damped))
    return damping


_HALVINGS = 5
"""How finely the fraction of the last level that stays is found: to 1/32."""


def truncate_levels(
    steps: Sequence[Float64[np.ndarray, " nv"]],
    fits: Callable[[Float64[np.ndarray, " nv"]], bool],
) -> Float64[np.ndarray, " nv"]:
    """The acceleration that keeps as many levels as fit, and a fraction of the next.

    Args:
        steps: accelerations with one more level each time; the last, with all, does not fit.
        fits: whether an acceleration can be brought about; called last with the answer.

    Returns:
        An acceleration that fits, or that of all levels where not even the first step does.
    """
    kept = len(steps) - 2
    while kept >= 0 and not fits(steps[kept]):
        kept -= 1
    if kept < 0:
        # Nothing that is left out would help: what is asked for comes as near as it can.
        fits(steps[-1])
        return steps[-1]
    low, high = 0.0, 1.0
    base, step = steps[kept], steps[kept + 1] - steps[kept]
    for _ in range(_HALVINGS):
        fraction = 0.5 * (low + high)
        if fits(base + fraction * step):
            low = fraction
        else:
            high = fraction
    answer = base + low * step
    fits(answer)
    return answer
