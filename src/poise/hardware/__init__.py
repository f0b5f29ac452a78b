"""The way to a real robot: one contract, `Link`, and what stands between controller and drives."""

from poise.hardware._link import (
    Link,
    LinkInfo,
    LinkStatus as LinkStatus,
    MotorCommand,
    MotorState,
)

__all__ = [
    "Link",
    "LinkInfo",
    "MotorCommand",
    "MotorState",
]
