"""`DevicePlan`: how the foot devices move in a scenario whose robot is walked by an operator."""

from dataclasses import dataclass
from typing import Annotated

from poise._schema import Bounds, Seconds, Truth, checked
from poise.apps.teleoperation import SCRIPTS, BadOperator, PoorLink, Script
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import Device, ScriptedDevice, StepTeleoperator, WayPoint

NAME = "step_teleoperation"
"""What scenario files call the controller."""


@checked()
@dataclass(frozen=True, kw_only=True)
class DevicePlan:
    """How the operator moves the foot devices, and what of it arrives at the robot.

    Attributes:
        script: one of `SCRIPTS`, which also has the blocks and the posture at the start; empty
            where there is none.
        points: in order of time, as offsets from where each foot stood at the start.
        bad_operator: whether they move at random, as no careful person would move them.
        latency: how long what they say is under way [s].
        loss: probability that a sample, one a tick, does not arrive.
    """

    script: str = ""
    points: tuple[WayPoint, ...] = ()
    bad_operator: Truth = False
    latency: Seconds = 0.0
    loss: Annotated[float, Bounds(least=0.0, most=1.0)] = 0.0

    def __post_init__(self) -> None:
        if self.script and self.script not in SCRIPTS:
            raise UnknownNameError("no such script of devices", got=self.script, choices=SCRIPTS)
        if bool(self.script) + bool(self.points) + self.bad_operator != 1:
            raise ConfigurationError(
                "devices need a script, points, or a bad operator",
                got=f"script {self.script!r}, {len(self.points)} points, "
                f"bad_operator {str(self.bad_operator).lower()}",
                wanted="one of the three",
            )

    def device(self, teleoperator: StepTeleoperator, script: Script | None, seed: int) -> Device:
        """The devices at the robot's end.

        Args:
            teleoperator: whose feet they lead.
            script: of the plan, for its robot; None where it has none.
            seed: of everything random.
        """
        points = self.points if script is None else script.points
        device: Device = ScriptedDevice(points, *teleoperator.estimator.anchors)
        if self.bad_operator:
            device = BadOperator(teleoperator, seed)
        if self.latency or self.loss:
            device = PoorLink(device, latency=self.latency, loss=self.loss, seed=seed)
        return device
