"""`DevicePlan`: how the foot devices move in a scenario whose robot is walked by an operator."""

from dataclasses import dataclass

from poise._schema import checked
from poise.apps.teleoperation import SCRIPTS
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import WayPoint

NAME = "step_teleoperation"
"""What scenario files call the controller."""


@checked()
@dataclass(frozen=True, kw_only=True)
class DevicePlan:
    """How the operator moves the foot devices: one of the scripts, or way-points.

    Attributes:
        script: one of `SCRIPTS`, which also has the blocks and the posture at the start; empty
            where there are points.
        points: in order of time, as offsets from where each foot stood at the start.
    """

    script: str = ""
    points: tuple[WayPoint, ...] = ()

    def __post_init__(self) -> None:
        if self.script and self.script not in SCRIPTS:
            raise UnknownNameError("no such script of devices", got=self.script, choices=SCRIPTS)
        if bool(self.script) == bool(self.points):
            raise ConfigurationError(
                "devices need either a script or points",
                got=f"script {self.script!r} and {len(self.points)} points",
                wanted="one of the two",
            )
