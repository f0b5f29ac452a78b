"""`DrivePlan`: with which velocities a robot walks, by time.

`VelocityCommand`: one of them.
"""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated

from poise._schema import Bounds, Seconds, Text, Vector, checked
from poise.errors import ConfigurationError
from poise.locomotion import Gait, Ground, VelocityLimits, Walker, WalkSettings
from poise.robots import Robot
from poise.stack import Stack


@checked()
@dataclass(frozen=True, kw_only=True)
class VelocityCommand:
    """From a time on the robot walks with a velocity; what is beyond its limits is cut.

    Attributes:
        at: when [s].
        velocity: ahead [m/s], to the left [m/s], and turning to the left [rad/s].
    """

    at: Seconds
    velocity: Annotated[tuple[float, float, float], Vector(3, Bounds(most=10.0, unit="m/s, rad/s"))]


@checked()
@dataclass(frozen=True, kw_only=True)
class DrivePlan:
    """With which velocities a robot walks, by time; it makes its steps while it walks.

    Attributes:
        velocities: each holds until the next; at first the robot stands.
        gait: timing and shape of the steps; by the robot's size when None.
        feedback: how the balance is kept and the ground felt.
        limits: of velocities.
        carry: frame tasks that go along with the body; all that are on no sole when None.
    """

    velocities: tuple[VelocityCommand, ...]
    gait: Gait | None = None
    feedback: WalkSettings = field(default_factory=WalkSettings)
    limits: VelocityLimits = field(default_factory=VelocityLimits)
    carry: tuple[Text, ...] | None = None

    def __post_init__(self) -> None:
        times = [command.at for command in self.velocities]
        if not times or any(a >= b for a, b in pairwise(times)):
            raise ConfigurationError(
                "velocities of a drive are not one after the other",
                got=times,
                wanted="one or more, at times that grow",
            )

    def walker(self, robot: Robot, stack: Stack, ground: Ground) -> Walker:
        """The walker of a robot from its home posture."""
        return Walker(
            robot, stack, self.gait, self.feedback, self.limits, ground=ground, carry=self.carry
        )
