"""Settings of a walker's feedback and touchdown, and the status of a walk."""

from dataclasses import dataclass
from enum import Enum
from typing import Annotated

from poise._schema import Bounds, Ratio, checked
from poise.locomotion._walking._footsteps import LARGEST
from poise.locomotion._walking._ground import CLEARANCE

_Distance = Annotated[float, Bounds(least=0.0, most=LARGEST, unit="m")]


@checked(
    removed=dict.fromkeys(
        ("early", "adjust", "com_bound"), "none: it is the same for every robot and walk"
    )
)
@dataclass(frozen=True, kw_only=True)
class WalkSettings:
    """Feedback, touchdown and limits of a walker.

    Attributes:
        dcm_gain: how fast an error of the DCM dies out [1/s].
        zmp_margin: how far inside the soles' edges the ZMP that corrects it stays [m].
        touchdown_force: ratio of the robot's weight at which a foot counts as down.
        touchdown_depth: how far below the expected ground a foot aims [m].
        search_depth: how far below the expected ground a late foot looks for it [m].
        patience: how long a foot may be late [s].
        bounce_time: a foot without load for this long just after touchdown has bounced off [s].
        clearance: least distance between the edges of the soles at touchdown [m].
    """

    dcm_gain: Annotated[float, Bounds(positive=True, most=LARGEST, unit="1/s")] = 4.0
    zmp_margin: _Distance = 0.01
    touchdown_force: Ratio = 0.05
    touchdown_depth: _Distance = 0.003
    search_depth: _Distance = 0.1
    patience: Annotated[float, Bounds(positive=True, most=LARGEST, unit="s")] = 0.4
    bounce_time: Annotated[float, Bounds(positive=True, most=LARGEST, unit="s")] = 0.01
    clearance: _Distance = CLEARANCE


class WalkStatus(Enum):
    """State of a walk, or why it ended."""

    READY = "ready"
    """No state has come yet."""
    STANDING = "standing"
    """Both feet stay on the ground, without commands."""
    WALKING = "walking"
    """The robot steps."""
    MISPLACED = "misplaced"
    """The feet were not where the plan begins: nothing was moved."""
    FOOT_LOST = "foot_lost"
    """A foot found no ground: it is held, and the robot balances on the other."""
    COM_LOST = "com_lost"
    """The CoM ran away from its reference: velocities wait, steps go on catching the robot."""
    FOOT_CAUGHT = "foot_caught"
    """A swing foot is blocked, and put down where it is."""
    SLIPPING = "slipping"
    """A sole that carries the robot slips: it walks more slowly."""
    LIFTED = "lifted"
    """No foot is loaded: commands are ignored until one is."""
    FALLEN = "fallen"
    """The robot has fallen: commands are ignored."""

    @property
    def ok(self) -> bool:
        """True without a fault."""
        return self in _FINE


_FINE = (WalkStatus.READY, WalkStatus.STANDING, WalkStatus.WALKING)
