"""`DevicePlan`: how the foot devices move in a scenario whose robot is walked by an operator."""

from dataclasses import dataclass
from typing import Annotated

from poise._schema import AnyText, Bounds, Seconds, Truth, checked
from poise.apps.teleoperation import SCRIPTS, BadOperator, PoorLink, Script, read_recording
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
        recording: file of a recorded run of any robot, whose samples are sent; empty for none.
        latency: how long what they say is under way [s].
        loss: probability that a sample, one a tick, does not arrive.
    """

    script: str = ""
    points: tuple[WayPoint, ...] = ()
    bad_operator: Truth = False
    recording: AnyText = ""
    latency: Seconds = 0.0
    loss: Annotated[float, Bounds(least=0.0, most=1.0)] = 0.0

    def __post_init__(self) -> None:
        if self.script and self.script not in SCRIPTS:
            raise UnknownNameError("no such script of devices", got=self.script, choices=SCRIPTS)
        ways = {
            "script": self.script,
            "points": self.points,
            "bad_operator": self.bad_operator,
            "recording": self.recording,
        }
        given = [name for name, way in ways.items() if way]
        if len(given) != 1:
            raise ConfigurationError(
                "devices are led in one way", got=given, wanted="one key", choices=ways
            )

    def device(self, teleoperator: StepTeleoperator, script: Script | None, seed: int) -> Device:
        """The devices at the robot's end."""
        if self.recording:
            device: Device = read_recording(self.recording).device(teleoperator)
        elif self.bad_operator:
            device = BadOperator(teleoperator, seed)
        else:
            points = self.points if script is None else script.points
            device = ScriptedDevice(points, *teleoperator.estimator.anchors)
        if self.latency or self.loss:
            device = PoorLink(device, latency=self.latency, loss=self.loss, seed=seed)
        return device
