"""The way to a real robot: one contract, `Link`, and what stands between controller and drives."""

from poise.hardware._last_check import LastCheck
from poise.hardware._link import (
    Link,
    LinkInfo,
    LinkStatus as LinkStatus,
    MotorCommand,
    MotorState,
)

__all__ = [
    "LastCheck",
    "Link",
    "LinkInfo",
    "MotorCommand",
    "MotorState",
]
