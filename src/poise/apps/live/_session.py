"""`LiveSession`: loop, page and gamepad together, and the orders of a page."""

import math
import time as clock
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import msgspec
from msgspec import structs

from poise.apps.deployment import FLUSH, LinkedPlant
from poise.apps.live._front import Answer, Front
from poise.apps.live._gamepad import HostGamepad
from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._leads import WALK_PLANT, FootLead, VelocityLead, rehearse
from poise.apps.live._log import Takes
from poise.apps.live._loop import LiveLoop, Order, Pause, PushOrder, Reset, Slow, Stop
from poise.apps.report import shapes_payload
from poise.apps.scenarios import drawn_shapes
from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, Recording
from poise.errors import ConfigurationError
from poise.locomotion import OperatorSample, TeleopParameters
from poise.robots import Robot
from poise.sim import PlantConfig, RecorderConfig


class Keep(Order):
    """Keep a copy of the run so far."""


_ORDERS: msgspec.json.Decoder[OperatorSample | PushOrder | Pause | Slow | Reset | Keep | Stop] = (
    msgspec.json.Decoder(OperatorSample | PushOrder | Pause | Slow | Reset | Keep | Stop)
)


class LiveSession:
    """A robot simulated in real time and teleoperated; a context manager that closes all threads.

    Args:
        robot: a biped with legs of six joints, or any humanoid where it walks by velocities.
        folder: for the recordings.
        by: the operator leads the "feet", by step teleoperation, or the "velocity" of a walk.
        port: of the page; 0 for any that is free.
        gamepad: take commands from a gamepad on this machine, in place of the page.
        recording: motion of the feet, in place of an operator.
        plant: with torque actuation, or for feet with velocity, as in the paper; the usual when
            None.
        seed: of the sensor noise.
        parameters: of the teleoperator; scaled to the robot when None.
        solved_by: name of the controller that solves the teleoperator's stack.
        connect: returns the robot behind a link in place of a simulated one, by its
            posture at the start; it is called when everything has been compiled.

    Raises:
        ConfigurationError: the robot cannot be walked, or an option of feet for a velocity.
        UnknownNameError: no controller of that name for the plant's actuation.
        RecordingError: the recording has no samples, or settings that cannot be.
        PortInUseError: the port is taken.
        NoGamepadError: a gamepad is wanted and none is there.

    Attributes:
        loop: runs the robot.
        inputs: newest sample of the operator.
        takes: recordings of the session.
        front: server of the page, with its addresses and the operator's seat.
    """

    def __init__(
        self,
        robot: Robot,
        folder: str | Path,
        *,
        by: Literal["feet", "velocity"] = "feet",
        port: int = 0,
        gamepad: bool = False,
        recording: Recording | None = None,
        plant: PlantConfig | None = None,
        seed: int = 0,
        parameters: TeleopParameters | None = None,
        solved_by: str | None = None,
        connect: Callable[[PlantConfig], LinkedPlant] | None = None,
    ) -> None:
        self.inputs = inputs = OperatorInputs()
        self._gamepad = HostGamepad(inputs, self._stop) if gamepad else None
        self._source = "gamepad" if gamepad else "browser" if recording is None else "recording"
        if by == "feet":
            lead = FootLead(
                robot,
                inputs,
                plant or TORQUE_TELEOP_PLANT,
                seed=seed,
                recording=recording,
                parameters=parameters,
                solved_by=solved_by,
            )
        elif recording or parameters or solved_by:
            raise ConfigurationError(
                "recording, parameters and solved_by are for feet", got=by, wanted='by="feet"'
            )
        else:
            lead = VelocityLead(robot, inputs, plant or WALK_PLANT, seed=seed)
        self.takes = Takes(Path(folder), lead.takes)
        linked = None
        if connect is not None:
            rehearse(lead)
            linked = connect(lead.plant)
            linked.body.operator = self.inputs.heard
            lead.recording = RecorderConfig(flush_dt=FLUSH, scene_dt=0.1, keep=False)
        self.loop = LiveLoop(lead, self.takes, linked)
        self._last: dict[type[Order], float] = {}
        model = self.loop.plant.drawn_model()
        shapes = {"bodies": model.nbody, **shapes_payload(drawn_shapes(model))}
        self.front = Front(self, port=port, shapes=shapes)

    def __enter__(self) -> "LiveSession":
        self.loop.start()
        if self._gamepad is not None:
            self._gamepad.start(lambda: self.loop.lead.landings)
        self.front.start()
        return self

    def __exit__(self, *_: object) -> None:
        # The recording first: nothing after it can cost it anything.
        self.loop.stop()
        if self._gamepad is not None:
            self._gamepad.stop()
        self.front.stop()

    def wait(self, seconds: float = math.inf) -> None:
        """Wait until time is up [s]; raise the error that ended the loop."""
        end = clock.monotonic() + seconds
        while self.loop.running and clock.monotonic() < end:
            clock.sleep(0.1)
        if self.loop.error is not None:
            raise self.loop.error

    # What the page asks for ----------------------------------------------------------------------

    def order(self, text: str | bytes) -> Answer | Callable[[], Answer]:
        """Carry out a message of the operator's page."""
        try:
            message = _ORDERS.decode(text)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise ConfigurationError(f"no such order: {error}") from None
        match message:
            case OperatorSample():
                # As often as a device asks: forces are no use to it later.
                answer = {"echo": message.time, "forces": self.loop.lead.forces}
                return answer | (self.inputs.take(message) if self._source == "browser" else {})
            case PushOrder() | Pause() | Slow() | Reset() if self.loop.linked:
                return {"error": "Not on a robot behind a link."}
            case Reset() | Keep() if not self._is_rare(type(message)):
                return {"error": "Not again within a second."}
            case Keep():
                return lambda: {"kept": self.takes.keep().name}
            case _:
                self.loop.order(message)
                if isinstance(message, Reset):
                    # Held levers belong to the run before.
                    self.inputs.clear()
        return None

    def _is_rare(self, order: type[Order]) -> bool:
        """Return whether an order that writes files was not just given; from now on it was."""
        now = clock.monotonic()
        rare = now - self._last.get(order, -math.inf) >= 1.0
        if rare:
            self._last[order] = now
        return rare

    def _stop(self) -> None:
        self.loop.order(Stop())

    def left(self) -> None:
        """Forget an operator who has gone: the feet go back to the ground."""
        if self._source == "browser":
            self.inputs.clear()

    def status(self) -> dict[str, Any]:
        """Return the data that all pages display."""
        lead, now = self.loop.lead, self.loop.snapshot
        about = {
            "robot": lead.robot.name,
            "source": self._source,
            "kind": lead.kind,
            "linked": self.loop.linked,
            "limits": lead.limits._asdict(),
            "asked": structs.asdict(lead.body),
        }
        return about if now is None else about | now.message()

    def file(self, name: str) -> Path | None:
        """Return a recording by its name; None where there is none."""
        return self.takes.folder / name if name in self.takes.files else None
