"""`WalkSettings`: how a walker keeps its balance and feels the ground."""

from dataclasses import dataclass, fields

from poise.checks import checked_number
from poise.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class WalkSettings:
    """Feedback, touchdown and limits of a walker.

    Attributes:
        dcm_gain: how fast an error of the divergent component of motion dies out [1/s].
        zmp_margin: how far inside the soles' edges the ZMP that corrects it stays [m].
        touchdown_force: share of the robot's weight at which a foot counts as down.
        touchdown_depth: how far below the expected ground a foot aims [m].
        early: share of the swing after which ground counts as ground.
        search_depth: how far below the expected ground a late foot looks for it [m].
        patience: how long a foot may be late [s].
        adjust: farthest that a foothold moves from its plan to catch the robot [m]; 0 for never.
        com_bound: distance of the divergent component from its reference, over the height of the
            COM, beyond which the walk is given up.
    """

    dcm_gain: float = 4.0
    zmp_margin: float = 0.01
    touchdown_force: float = 0.05
    touchdown_depth: float = 0.003
    early: float = 0.5
    search_depth: float = 0.04
    patience: float = 0.4
    adjust: float = 0.2
    com_bound: float = 0.4

    def __post_init__(self) -> None:
        for field in fields(self):
            zero = field.name in ("zmp_margin", "touchdown_depth", "search_depth", "adjust")
            checked_number(
                getattr(self, field.name),
                f"{field.name} of the walk's settings",
                above=None if zero else 0.0,
            )
        for name in ("touchdown_force", "early"):
            if getattr(self, name) >= 1.0:
                raise ConfigurationError(
                    f"{name} of the walk's settings is out of range",
                    got=getattr(self, name),
                    wanted="a share below one",
                )
