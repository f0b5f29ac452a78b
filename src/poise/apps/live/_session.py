"""`LiveSession`, `DriveSession`: loop, page and gamepad together, and what a page may order."""

import math
import time as clock
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from jaxtyping import Float64
from msgspec import Struct, structs

from poise.apps.live._drive import DRIVE_PLANT, DriveLoop
from poise.apps.live._front import Answer, Front
from poise.apps.live._gamepad import HostGamepad
from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._log import Takes
from poise.apps.live._loop import LiveLoop
from poise.apps.live._real_time import RealTimeLoop
from poise.apps.report import shapes_payload
from poise.apps.scenarios import drawn_shapes
from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, Recording
from poise.errors import ConfigurationError
from poise.locomotion import OperatorSample, TeleopParameters
from poise.robots import Robot
from poise.sim import PlantConfig

Source = Literal["browser", "gamepad", "recording"]
"""Where the feet are led from."""


class _Order(Struct, forbid_unknown_fields=True, tag_field="do", tag=str.lower):
    """Message of an operator's page beside `OperatorSample`."""


class PushOrder(_Order, tag="push"):
    """The torso is pushed."""

    value: Literal["left", "right", "forward", "back"]


class Pause(_Order):
    """Time stands still, or goes on."""

    value: bool


class Slow(_Order):
    """Slow motion, or real time."""

    value: bool


class Reset(_Order):
    """The robot goes back to its start."""


class Keep(_Order):
    """A copy of the run so far is kept."""


_ORDERS: msgspec.json.Decoder[OperatorSample | PushOrder | Pause | Slow | Reset | Keep] = (
    msgspec.json.Decoder(OperatorSample | PushOrder | Pause | Slow | Reset | Keep)
)
"""JSON whose member `do` is the name of an order, or "drive" for an `OperatorSample`."""


_RARE = 1.0
"""Time from one reset to the next, and from one copy to the next, at least [s]."""

_WAIT = {"error": "Not again within a second."}


class _Session(ABC):
    """A robot, whoever leads it and whoever looks on.

    Attributes:
        kind: "feet" where they are led, "velocity" where the robot is driven.
    """

    kind: Literal["feet", "velocity"]

    def __init__(
        self,
        loop: RealTimeLoop,
        inputs: OperatorInputs,
        *,
        port: int,
        gamepad: HostGamepad | None,
        source: Source,
    ) -> None:
        self.loop, self.inputs = loop, inputs
        self._gamepad, self._source = gamepad, source
        self._last: dict[type[_Order], float] = {}
        model = loop.plant.drawn_model()
        shapes = {"bodies": model.nbody, **shapes_payload(drawn_shapes(model))}
        self.front = Front(self, port=port, shapes=shapes)

    @abstractmethod
    def _keep(self) -> dict[str, Any]:
        """Keeps a copy of the run so far; an answer for the page."""

    def file(self, name: str) -> Path | None:
        """A recording by its name; None when there is none."""
        return self._recordings().get(name)

    @abstractmethod
    def _recordings(self) -> dict[str, Path]:
        """What may be fetched, by name."""

    def _start(self) -> None:
        self.loop.start()
        if self._gamepad is not None:
            self._gamepad.start(self.loop)
        self.front.start()

    def __exit__(self, *_: object) -> None:
        # The recording first: nothing after it can cost it anything.
        self.loop.stop()
        if self._gamepad is not None:
            self._gamepad.stop()
        self.front.stop()

    def wait(self, seconds: float = math.inf) -> None:
        """Waits until time is up."""
        end = clock.monotonic() + seconds
        while self.loop.running and clock.monotonic() < end:
            clock.sleep(0.1)
        if self.loop.error is not None:
            raise self.loop.error

    # What the front asks for ---------------------------------------------------------------------

    def order(self, text: str | bytes) -> Answer | Callable[[], Answer]:
        """Carries out a message of the operator's page."""
        try:
            message = _ORDERS.decode(text)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise ConfigurationError(f"no such order: {error}") from None
        match message:
            case OperatorSample():
                # As often as a device asks: what the feet feel is no use to it later.
                answer = {"echo": message.time, "forces": self.loop.forces}
                if self._source == "browser":
                    answer |= self.inputs.take(message)
                return answer
            case PushOrder():
                self.loop.push(message.value)
            case Pause():
                self.loop.pause(message.value)
            case Slow():
                self.loop.slow(message.value)
            case Reset():
                if not self._is_rare(Reset):
                    return _WAIT
                self.loop.reset()
                # What is held was to lead the robot of before.
                self.inputs.clear()
            case Keep():
                return self._keep if self._is_rare(Keep) else _WAIT
        return None

    def _is_rare(self, order: type[_Order]) -> bool:
        """Whether an order that writes files has not just been given; from now on it has."""
        now = clock.monotonic()
        rare = now - self._last.get(order, -math.inf) >= _RARE
        if rare:
            self._last[order] = now
        return rare

    def left(self) -> None:
        """The operator's page has gone: no more samples, the feet go back to the ground."""
        if self._source == "browser":
            self.inputs.clear()

    def status(self) -> dict[str, Any]:
        """What every page shows."""
        now = self.loop.snapshot
        common = {
            "robot": self.loop.robot.name,
            "source": self._source,
            "kind": self.kind,
            "limits": self.loop.limits._asdict(),
            "asked": structs.asdict(self.loop.asked),
        }
        if now is None:
            return common
        return common | {
            "time": round(now.time, 3),
            "mode": now.mode.name,
            "modeText": now.text or now.mode.value,
            "device": now.device.name,
            "deviceText": now.device.value,
            "zmp": _rounded(now.zmp),
            "zmpReference": _rounded(now.zmp_reference),
            "com": _rounded(now.com),
            "soles": _rounded(now.soles),
            "handles": _rounded(now.handles),
            "heading": round(now.heading, 4),
            "hands": _rounded(now.hands),
            "handsDo": [hand.name for hand in now.hands_do],
            "handTurns": [None if t is None else _rounded(t.ravel()) for t in now.hand_turns],
            "gaze": None if now.gaze is None else now.gaze.name,
            "target": None if now.target is None else _rounded(now.target),
            "polygon": _rounded(now.polygon),
            "bodies": _rounded(now.bodies.ravel()),
            "turns": _rounded(now.turns.ravel()),
            "margin": round(now.margin, 4),
            "loads": [round(float(load), 1) for load in now.loads],
            "tilt": round(now.tilt, 4),
            "fallen": now.fallen,
            "paused": now.paused,
            "speed": now.speed,
            "realTimeFactor": round(now.real_time_factor, 3),
            "take": now.take,
        }


class LiveSession(_Session):
    """A robot that a person drives; a context manager that ends everything.

    Args:
        robot: a biped.
        folder: where the run is recorded.
        port: of the page; 0 for any that is free.
        gamepad: whether a gamepad on this machine drives the feet, in place of the page.
        recording: drives in place of a person, as in `LiveLoop`.
        plant: with torque actuation, or velocity, as in the paper.
        seed: of the sensor noise.
        parameters: of the teleoperator; scaled to the robot when None.
        solved_by: name of the controller that solves the stack, see `StepTeleoperator`.

    Raises:
        ConfigurationError: the robot cannot be walked.
        UnknownNameError: no such controller of what the plant takes.
        RecordingError: the recording has no samples, or settings that cannot be.
        PortInUseError: the port is taken.
        NoGamepadError: a gamepad is wanted and none is there.
    """

    kind = "feet"
    loop: LiveLoop

    def __init__(
        self,
        robot: Robot,
        folder: str | Path,
        *,
        port: int = 0,
        gamepad: bool = False,
        recording: Recording | None = None,
        plant: PlantConfig = TORQUE_TELEOP_PLANT,
        seed: int = 0,
        parameters: TeleopParameters | None = None,
        solved_by: str | None = None,
    ) -> None:
        inputs = OperatorInputs()
        source: Source = "gamepad" if gamepad else "browser" if recording is None else "recording"
        host = HostGamepad(inputs) if gamepad else None
        self.takes = Takes(Path(folder))
        loop = LiveLoop(
            robot,
            inputs,
            self.takes,
            recording=recording,
            plant=plant,
            seed=seed,
            parameters=parameters,
            solved_by=solved_by,
        )
        super().__init__(loop, inputs, port=port, gamepad=host, source=source)

    def __enter__(self) -> "LiveSession":
        self._start()
        return self

    def _keep(self) -> dict[str, Any]:
        return {"kept": self.takes.keep().name}

    def _recordings(self) -> dict[str, Path]:
        return {name: self.takes.folder / name for name in self.takes.files}


class DriveSession(_Session):
    """A robot that a person drives by velocities; a context manager that ends everything.

    Args:
        robot: a humanoid.
        folder: where the run is logged.
        port: of the page; 0 for any that is free.
        gamepad: whether a gamepad on this machine drives it, in place of the page.
        plant: with torque actuation.
        seed: of the sensor noise.

    Raises:
        ConfigurationError: the robot cannot walk.
        PortInUseError: the port is taken.
        NoGamepadError: a gamepad is wanted and none is there.
    """

    kind = "velocity"
    loop: DriveLoop

    def __init__(
        self,
        robot: Robot,
        folder: str | Path,
        *,
        port: int = 0,
        gamepad: bool = False,
        plant: PlantConfig = DRIVE_PLANT,
        seed: int = 0,
    ) -> None:
        inputs = OperatorInputs()
        source: Source = "gamepad" if gamepad else "browser"
        host = HostGamepad(inputs) if gamepad else None
        loop = DriveLoop(robot, inputs, Path(folder), plant=plant, seed=seed)
        super().__init__(loop, inputs, port=port, gamepad=host, source=source)

    def __enter__(self) -> "DriveSession":
        self._start()
        return self

    def _keep(self) -> dict[str, Any]:
        return {"error": "The log is written while the robot is driven; nothing is lost."}

    def _recordings(self) -> dict[str, Path]:
        # A log is written while the robot is driven; its folder has it.
        return {}


def _rounded(values: Float64[np.ndarray, "..."]) -> list[Any]:
    """Numbers without figures that nobody can see."""
    return np.round(values, 4).tolist()
