"""`poise teleop` and `poise drive`: teleoperate the simulated robot, live."""

import signal
import sys
import threading
import webbrowser
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import arg

from poise.cli._command import OK
from poise.errors import ConfigurationError, import_extra


@dataclass(frozen=True, kw_only=True)
class _Live:
    """Options of verbs that run a robot in real time with a page.

    Attributes:
        port: port of the page, 0 for any that is free.
        noise: give sensors the noise of usual ones.
        seed: seed of --noise, and of the places of bumps; a recording has its own.
        seconds: end after so many seconds.
        no_open: do not open the page in a browser.
        link: interface of a robot behind a link, as eth0, or lo for a simulated one, in place of
            the simulated robot of the page; it has to be a g1.
        tag: of the participants on its bus.
        priority: of the link's process under SCHED_FIFO, 1 to 99.
        without_preflight: leave its preflight out.
        out: folder to write into.
    """

    port: int = 8080
    noise: bool = False
    seed: int = 0
    seconds: float = inf
    no_open: bool = False
    link: str | None = None
    tag: str = ""
    priority: int | None = None
    without_preflight: bool = False
    out: Annotated[str | None, arg(metavar="DIR")] = None

    def __post_init__(self) -> None:
        if not self.seconds > 0.0:
            raise ConfigurationError("--seconds is out of range", got=self.seconds, wanted="> 0")

    def run(self, robot: Any, device: str, hint: str, remark: str = "", **options: Any) -> int:
        """Run a session until its time is up or it is ended, and name the logs it leaves."""
        from poise.apps.live import LiveSession

        verb = type(self).__name__.removesuffix("Verb").lower()
        folder = Path(self.out or f"runs/{verb}-{Path(robot.name).stem}")
        if self.link is not None:
            from poise.cli._deploy import linked_plant

            options["connect"] = partial(
                linked_plant,
                robot,
                interface=self.link,
                tag=self.tag,
                priority=self.priority,
                without_preflight=self.without_preflight,
            )
        session = LiveSession(
            robot,
            folder,
            port=self.port,
            gamepad=device == "gamepad",
            seed=self.seed,
            **options,
        )
        if remark:
            print(f"poise: {remark}", file=sys.stderr)
        logs = set(folder.glob("*.mcap"))
        # Termination of the process is handled like Ctrl-C: recordings are completed first.
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            with session:
                print(f"{robot.name} is running.")
                print(f"  drive: {session.front.drive_url}")
                print(f"  watch: {session.front.watch_url}")
                # Flushed, so that it is there when the output is a pipe.
                print(f"{hint}\nCtrl-C ends.", flush=True)
                if not self.no_open:
                    # Some browsers, those of a terminal above all, return only when they end.
                    address = (session.front.drive_url,)
                    threading.Thread(target=_open, args=address, daemon=True).start()
                session.wait(self.seconds)
        except KeyboardInterrupt:
            pass
        finally:
            signal.signal(signal.SIGTERM, before)
        found = sorted(path.name for path in set(folder.glob("*.mcap")) - logs)
        takes = session.takes
        none = "none" if takes.problem else "none, nobody drove"
        print(f"recordings in {folder}: {', '.join(found) if found else none}")
        if takes.problem:
            print(f"poise: {takes.problem}", file=sys.stderr)
        return OK


def _open(address: str) -> None:
    if not webbrowser.open(address):
        print("no browser could be opened here: open the first address yourself", file=sys.stderr)


@dataclass(frozen=True, kw_only=True)
class DriveVerb(_Live):
    """Start a simulated humanoid in real time and a page on 127.0.0.1 to drive it from.

    Open the address that is printed; arrow keys or W, A, S, D walk, Q and E turn, and a gamepad's
    sticks do both. The robot plans its own steps, and stops without an operator. The
    address without its token is for spectators. Ctrl-C ends; every run is logged in
    runs/drive-ROBOT, or in the folder of --out.

    example: poise drive --robot g1

    Attributes:
        robot: a humanoid: a name that `poise robots` lists, or a file.
        device: device that drives it: browser (its keys, or a gamepad at its computer), or gamepad
            (one at this machine).
    """

    robot: str = "humanoid33"
    device: Literal["browser", "gamepad"] = "browser"

    def act(self) -> int:
        """Run until it is ended."""
        from poise.apps.live import WALK_PLANT
        from poise.robots import load_robot

        hint = "To walk: arrow keys; to turn: Q and E."
        plant = WALK_PLANT.with_noise() if self.noise else WALK_PLANT
        return self.run(load_robot(self.robot), self.device, hint, by="velocity", plant=plant)


@dataclass(frozen=True, kw_only=True)
class TeleopVerb(_Live):
    """Start a simulated biped in real time and a page on 127.0.0.1 to drive it from.

    To step: open the address that is printed, hold key Q (left foot) or E (right foot), or drag the
    vertical arrow of a foot's handle up; the robot shifts its weight and lifts the foot; move it
    with the arrow keys; let go, and the foot is set down. Whoever has the address without its token
    can watch. Ctrl-C ends; every run is recorded in runs/teleop-ROBOT, or in the folder of --out.

    example: poise teleop --robot biped20 --terrain steps

    Attributes:
        robot: a biped, by name or file (biped20 by default); with a recording any other, and its
            own by default, unless that came from a file.
        device: device that leads the feet: browser (its mouse, keys, or a gamepad at its computer),
            gamepad (one at this machine), or the file of a recording, which is repeated bit for bit
            unless other options ask for another robot or run.
        actuation: command of the joints: torque, so that the feet lie as the ground does, position,
            of servos that pull with these torques, or velocity, as in the paper (torque by default,
            or that of the recording).
        controller: controller that finds the torques: whole_body, reduced or osf (whole_body by
            default, or that of the recording).
        hand_scale: way of the robot's hands over that of the operator's (1 by default, or that of
            the recording).
        terrain: blocks on the floor: flat, obstacle, steps, or bumps, whose places the seed draws
            (flat by default, or that of the recording).
    """

    robot: str | None = None
    device: str = "browser"
    actuation: str | None = None
    controller: str | None = None
    hand_scale: float | None = None
    terrain: str | None = None

    def act(self) -> int:
        """Run until it is ended."""
        # Before the simulator is missed, which is in a smaller extra.
        import_extra("websockets", "teleop", "Live teleoperation")
        from poise.apps.teleoperation import recorded_robot
        from poise.robots import load_robot

        recording = _recording(self.device)
        if recording is None or self.robot is not None:
            robot = load_robot(self.robot or "biped20")
        else:
            what = f"the recording {recording.path.name}"
            robot = recorded_robot(recording.robot, what, option="--robot FILE")
        known = recording.setup if recording and "parameters" in recording.settings else None
        actuation = self.actuation or ("torque" if known is None else known.plant.actuation)
        made = None if recording is None else recording.setup_for(robot, actuation)
        plant = self._plant(robot, actuation, known, made)
        parameters = self._parameters(robot, plant.commanded, made)
        remark = ""
        if made is not None:
            asked = (plant, parameters or made.parameters, self.controller or made.solved_by)
            repeats = asked == (made.plant, made.parameters, made.solved_by)
        else:
            repeats = known is None and recording is not None and recording.is_of(robot)
        if recording is not None and not repeats:
            commanded = "" if known is None else f", {known.plant.actuation} commanded"
            remark = (
                f"the samples of {recording.path.name} were recorded with robot "
                f"{recording.robot}{commanded}; this is no replay of that run"
            )
        return self.run(
            robot,
            self.device,
            "To step: hold Q or E in the page, or drag a foot's handle up; let go to step down.",
            remark,
            recording=recording,
            plant=plant,
            parameters=parameters,
            solved_by=self.controller,
        )

    def _plant(self, robot: Any, actuation: str, known: Any, made: Any) -> Any:
        """Plant of a recording that is repeated, else one whose links touch; with the terrain."""
        from poise.apps import teleoperation as t

        if made is None:
            velocity = actuation == "velocity"
            plant = t.VELOCITY_TELEOP_PLANT if velocity else t.TORQUE_TELEOP_PLANT
            blocks = () if known is None else known.plant.blocks
            # A person may lead hands and feet into the robot.
            plant = replace(plant, actuation=actuation, self_contact=True, blocks=blocks)
        else:
            plant = made.plant
        if self.noise:
            plant = plant.with_noise()
        if self.terrain is None:
            return plant
        return replace(plant, blocks=t.terrain_blocks(self.terrain, robot, seed=self.seed))

    def _parameters(self, robot: Any, actuation: str, made: Any) -> Any:
        """Parameters of recording or robot with another scale of the hands; None for no change."""
        from poise.locomotion import teleop_parameters

        if self.hand_scale is None:
            return None
        usual = teleop_parameters(robot, actuation) if made is None else made.parameters
        return replace(usual, hand_scale=self.hand_scale)


def _recording(device: str) -> Any:
    """The recording that a device names, None for a person."""
    from poise.apps.teleoperation import RecordingError, read_recording

    path = Path(device)
    if device in ("browser", "gamepad"):
        return None
    if not path.is_file():
        wanted = "browser, gamepad, or the file of a recording"
        raise ConfigurationError("no such device", got=device, wanted=wanted)
    try:
        return read_recording(path)
    except RecordingError as error:
        # What a run that was killed has left can be played as far as it goes.
        recording = read_recording(path, allow_partial=True)
        print(f"poise: {error.what}; playing what there is", file=sys.stderr)
        return recording
