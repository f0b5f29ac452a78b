"""`TorqueStep`: no torque changes by more than a bound from one tick to the next.

`DemandLimit`: how hard a level may drive the joints.
`shed`: lets go of tasks from the bottom up until contacts and torque limits hold.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers, checked_number
from poise.errors import ConfigurationError
from poise.robots import Robot

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


_HALVINGS = 5
"""How finely the share of the last task that stays is found: to 1/32."""


def shed(
    steps: Sequence[Float64[np.ndarray, " nv"]],
    fits: Callable[[Float64[np.ndarray, " nv"]], bool],
) -> Float64[np.ndarray, " nv"]:
    """The acceleration that keeps as many levels as fit, and a share of the next.

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
    base, way = steps[kept], steps[kept + 1] - steps[kept]
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        if fits(base + share * way):
            low = share
        else:
            high = share
    answer = base + low * way
    fits(answer)
    return answer


DEFAULT_SHARE = 0.1
"""Largest change of a torque in a tick, as a share of its limit, where the user gives none."""


class TorqueStep:
    """Moves along the straight line from the last torques to the new ones, as far as allowed.

    All joints go the same share of their way: torques that hold contacts and limits form a convex
    set at one state, so that what lies between two of them holds too.

    Args:
        robot: the robot.
        bound: largest change in a tick [N m], one number or one a joint; infinite for none; a tenth
            of the torque limits when None.

    Raises:
        ConfigurationError: a bound that is not positive, or of the wrong length.
    """

    def __init__(self, robot: Robot, bound: Numbers | None) -> None:
        values = np.asarray(DEFAULT_SHARE * robot.tau_max if bound is None else bound, dtype=float)
        if values.shape not in ((), (robot.nj,)) or not np.all(values > 0.0):
            raise ConfigurationError(
                "torque_step of the controller is out of range",
                got=bound,
                wanted=f"a number > 0 [N m], or {robot.nj} of them",
            )
        self.bound: Float64[np.ndarray, " nj"] = np.broadcast_to(values, (robot.nj,)).copy()
        self._last: Float64[np.ndarray, " nj"] | None = None

    def limited(
        self, torque: Float64[np.ndarray, " nj"]
    ) -> tuple[Float64[np.ndarray, " nj"], bool]:
        """The torques of this tick.

        Args:
            torque: what is wanted [N m].

        Returns:
            What is allowed, and whether that is less than wanted.
        """
        last, self._last = self._last, torque
        if last is None:
            return torque, False
        change = torque - last
        ratio = float((np.abs(change) / self.bound).max())
        if ratio <= 1.0:
            return torque, False
        self._last = last + change / ratio
        return self._last, True

    def remember(self, torque: Float64[np.ndarray, " nj"]) -> None:
        """Takes note of torques that went another way [N m]."""
        self._last = torque

    def reset(self) -> None:
        """Forgets the last torques: the next ones are free."""
        self._last = None
