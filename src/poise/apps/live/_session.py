"""`LiveSession`: loop, drawing, page and gamepad together."""

import math
import threading
import time as clock
from pathlib import Path
from typing import Any, Literal

import numpy as np

from poise.apps.live._front import Front
from poise.apps.live._gamepad import HostGamepad
from poise.apps.live._inputs import OperatorInputs, Pad
from poise.apps.live._log import Takes
from poise.apps.live._loop import FRAMES_PER_SECOND, PUSHES, LiveLoop
from poise.apps.live._scene import HANDLE_ABOVE, HANDLES, Scene
from poise.apps.teleoperation import TELEOP_PLANT
from poise.errors import ConfigurationError
from poise.locomotion import Recording
from poise.robots import Robot
from poise.sim import PlantConfig

Source = Literal["browser", "gamepad", "recording"]
"""Where the hands come from."""

_LONGEST_GAP = 0.5
"""A picture is drawn at least this often [s]."""

_FARTHEST = 100.0
"""A handle further away than this [m] is none."""


class LiveSession:
    """A robot that a person drives; a context manager that ends everything.

    Args:
        robot: a biped.
        folder: where the run is recorded.
        port: of the page; 0 for any that is free.
        gamepad: whether a gamepad on this machine drives the feet, in place of the page.
        recording: plays this in place of a person.
        plant: with velocity actuation.
        seed: of the sensor noise.

    Raises:
        ConfigurationError: the robot cannot be walked.
        RecordingError: the recording is of another robot.
        PortInUseError: the port is taken.
        NoGamepadError: a gamepad is wanted and none is there.
    """

    def __init__(
        self,
        robot: Robot,
        folder: Path,
        *,
        port: int = 0,
        gamepad: bool = False,
        recording: Recording | None = None,
        plant: PlantConfig = TELEOP_PLANT,
        seed: int = 0,
    ) -> None:
        self.inputs = OperatorInputs()
        self._gamepad = HostGamepad(self.inputs) if gamepad else None
        self._source: Source = (
            "gamepad" if gamepad else "browser" if recording is None else "recording"
        )
        self.takes = Takes(folder, robot=robot.name, dt=plant.control_dt)
        self.loop = LiveLoop(
            robot, self.inputs, self.takes, recording=recording, plant=plant, seed=seed
        )
        self._held = [False, False]
        self.scene = Scene(self.loop.plant)
        try:
            self.front = Front(
                self, port=port, scene_port=self.scene.port, secret=self.scene.secret
            )
        except Exception:
            self.scene.stop()
            raise
        self._stop = threading.Event()
        self._drawer = threading.Thread(target=self._draw, name="poise drawing", daemon=True)

    def __enter__(self) -> "LiveSession":
        self.loop.start()
        if self._gamepad is not None:
            self._gamepad.start()
        self._drawer.start()
        self.front.start()
        return self

    def __exit__(self, *_: object) -> None:
        # The recording first: nothing after it can cost it anything.
        self.loop.stop()
        if self._gamepad is not None:
            self._gamepad.stop()
        self._stop.set()
        self._drawer.join()
        self.front.stop()
        self.scene.stop()

    def wait(self, seconds: float = math.inf) -> None:
        """Waits until time is up.

        Args:
            seconds: [s].

        Raises:
            Exception: whatever ended the loop.
        """
        end = clock.monotonic() + seconds
        while self.loop.running and clock.monotonic() < end:
            clock.sleep(0.1)
        if self.loop.error is not None:
            raise self.loop.error

    def _draw(self) -> None:
        # A browser that is busy drawing cannot say what the hands do: it gets fewer pictures.
        while not self._stop.wait(max(1.0 / FRAMES_PER_SECOND, min(self.inputs.gap, _LONGEST_GAP))):
            snapshot = self.loop.snapshot
            if snapshot is not None:
                self.scene.show(snapshot, (self._held[0], self._held[1]))

    # What the front asks for ---------------------------------------------------------------------

    def order(self, message: dict[str, Any]) -> dict[str, Any] | None:
        """Carries out a message of the operator's page.

        Args:
            message: `beat` with keys and buttons, or `do` with the name of an action.

        Returns:
            An answer for the page.

        Raises:
            ConfigurationError: no such message.
        """
        if "beat" in message:
            if self._source == "browser":
                self.inputs.pad(_pad(message))
            return {"echo": message["beat"]}
        action, value = message.get("do"), message.get("value")
        if action == "push" and isinstance(value, str) and value in PUSHES:
            self.loop.push(value)
        elif action == "pause" and isinstance(value, bool):
            self.loop.pause(value)
        elif action == "slow" and isinstance(value, bool):
            self.loop.slow(value)
        elif action == "reset":
            self.loop.reset()
        elif action == "keep":
            return {"kept": self.takes.keep().name}
        else:
            raise ConfigurationError(
                "no such order",
                got=(action, value),
                choices=("push", "pause", "slow", "reset", "keep"),
            )
        return None

    def handle(self, message: dict[str, Any]) -> None:
        """What the operator did with a handle.

        Args:
            message: of viser's transform controls.

        Raises:
            ConfigurationError: no such handle, or no place.
        """
        if self._source != "browser":
            return
        name, kind = str(message.get("name")), str(message.get("type"))
        feet = [i for i, known in enumerate(HANDLES) if known.endswith(name)]
        if not feet:
            raise ConfigurationError("no such handle", got=name, choices=HANDLES)
        foot = feet[0]
        if kind.endswith("DragEndMessage"):
            self.inputs.drag(foot, None)
            self._held[foot] = False
        elif kind.endswith("DragStartMessage"):
            self._held[foot] = True
        elif self._held[foot]:
            self.inputs.drag(foot, _place(message.get("position")) - HANDLE_ABOVE)

    def left(self) -> None:
        """The operator's page has gone: no more samples, the feet go back to the ground."""
        if self._source == "browser":
            self.inputs.clear()
        self._held = [False, False]

    def file(self, name: str) -> Path | None:
        """A recording by its name; None when there is none."""
        return self.takes.folder / name if name in self.takes.files else None

    def status(self) -> dict[str, Any]:
        """What every page shows."""
        now = self.loop.snapshot
        common = {"robot": self.loop.robot.name, "source": self._source}
        if now is None:
            return common
        return common | {
            "time": round(now.time, 3),
            "mode": now.mode.name,
            "modeText": now.mode.value,
            "device": now.device.name,
            "deviceText": now.device.value,
            "zmp": _short(now.zmp),
            "zmpReference": _short(now.zmp_reference),
            "com": _short(now.com),
            "soles": [_short(sole) for sole in now.soles],
            "hands": [_short(hand) for hand in now.hands],
            "margin": round(now.margin, 4),
            "loads": [round(float(load), 1) for load in now.loads],
            "tilt": round(now.tilt, 4),
            "fallen": now.fallen,
            "paused": now.paused,
            "speed": now.speed,
            "realTimeFactor": round(now.real_time_factor, 3),
            "take": now.take,
        }


def _short(values: np.ndarray) -> list[float]:
    return [round(float(v), 4) for v in values]


def _pad(message: dict[str, Any]) -> Pad:
    """Keys and buttons as a page says them."""
    lift, move = message.get("lift", [False, False]), message.get("move", [0.0, 0.0])
    fair = (
        isinstance(lift, list)
        and len(lift) == 2
        and isinstance(move, list)
        and len(move) == 2
        and all(isinstance(m, int | float) and abs(m) <= 1.0 for m in move)
    )
    if not fair:
        raise ConfigurationError(
            "no such keys", got=(lift, move), wanted="lift of two, move of two from -1 to 1"
        )
    return Pad(
        lift=(bool(lift[0]), bool(lift[1])),
        move=(float(move[0]), float(move[1])),
        upright=bool(message.get("upright")),
    )


def _place(value: Any) -> np.ndarray:
    fair = (
        isinstance(value, list)
        and len(value) == 3
        and all(isinstance(v, int | float) and abs(v) < _FARTHEST for v in value)
    )
    if not fair:
        raise ConfigurationError("no such place of a handle", got=value, wanted="x, y and z [m]")
    return np.array(value, dtype=np.float64)
