"""`RobotSize`: dimensions of a robot that stands, by which the paper's numbers are scaled."""

from dataclasses import dataclass

from poise.locomotion._pendulum import natural_frequency

_HEIGHT, _HALF_SOLE = 0.765, 0.12
"""Height of the COM and half the width of a sole of the paper's robot [m]."""


@dataclass(frozen=True, kw_only=True)
class RobotSize:
    """Mass, dimensions, and ratios to those of the paper's robot."""

    mass: float  # [kg]
    height: float  # of the COM over the soles [m]
    apart: float  # distance of the soles' centres across the heading [m]
    half_sole: float  # half the narrower side of the smaller sole [m]
    margin: float  # distance of the CT-ZMP from the soles' edges, at most the paper's [m]
    narrow: bool  # soles are too narrow for a push outwards, see `SingleSupportRegion`

    @property
    def tall(self) -> float:
        """Ratio of the COM's heights."""
        return self.height / _HEIGHT

    @property
    def wide(self) -> float:
        """Ratio of the soles' widths, at most 1: the kick of a landing has to stay within it."""
        return min(1.0, self.half_sole / _HALF_SOLE)

    def by_stiffness(self, value: float) -> float:
        """Scale by omega^2 = g / H, so that poles keep their ratio to the robot's own time."""
        return value * natural_frequency(self.height) ** 2 / natural_frequency(_HEIGHT) ** 2
