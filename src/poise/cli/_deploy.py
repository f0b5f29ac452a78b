"""`poise simulate` and `poise deploy`: a simulated robot behind its bus, and a robot behind a link."""

import signal
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional, arg

from poise._progress import Bar
from poise.cli._command import OK, Output, output_folder
from poise.cli._run import report_run
from poise.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class SimulateVerb:
    """Run a simulated robot behind the real one's bus, in real time.

    It hangs in a hoist, and is lowered onto its feet three seconds after it is commanded torque or
    stiffness. Any client of the robot's topics on the loopback interface can command it. Ctrl-C
    ends; with --out the truth is logged in simulated.mcap.

    example: poise simulate g1 --link dds

    Attributes:
        robot: the robot.
        link: its bus: dds, Unitree's topics rt/lowstate and rt/lowcmd.
        tag: of the participants on the bus; others do not see the robot.
        ideal: no motor model: ideal drives.
        noise: give the inertial unit the noise of usual ones.
        loss: probability that a message is lost.
        delay: delay of states [s].
        jitter: largest further delay of a state [s].
        reorder: probability that a state arrives after the next.
        frozen: joints whose encoder stands still.
        dead: joints whose motor gives no torque.
        begin: time at which these faults begin [s].
        seed: of everything random.
        seconds: end after so many seconds.
        out: folder for the log of the truth.
    """

    robot: Annotated[Positional[str], arg(metavar="ROBOT")] = "g1"
    link: Literal["dds"] = "dds"
    tag: str = ""
    ideal: bool = False
    noise: bool = True
    loss: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    reorder: float = 0.0
    frozen: tuple[str, ...] = ()
    dead: tuple[str, ...] = ()
    begin: float = 0.0
    seed: int = 0
    seconds: float = inf
    out: Annotated[str | None, arg(metavar="DIR")] = None

    def act(self) -> int:
        """Run until it is ended."""
        from poise.apps import deployment as d
        from poise.sim import MotorConfig, PlantConfig, Recorder

        robot = _g1(self.robot)
        names = ("loss", "delay", "jitter", "reorder", "frozen", "dead", "begin")
        faults = d.FaultPlan(**{name: getattr(self, name) for name in names})
        config = PlantConfig(control_dt=0.002, motors=None if self.ideal else MotorConfig.g1())
        config = config.with_noise() if self.noise else config
        plant = d.HoistedPlant(robot, config, seed=self.seed)
        end = d.simulate_g1(robot, tag=self.tag)
        simulated = d.SimulatedRobot(plant, end, faults, seed=self.seed)
        recorder = None
        if self.out is not None:
            Path(self.out).mkdir(parents=True, exist_ok=True)
            recorder = Recorder(Path(self.out) / "simulated.mcap")
        print(f"{robot.name} hangs in its hoist behind rt/lowstate and rt/lowcmd on lo.")
        print("To command it: poise deploy stand --interface lo\nCtrl-C ends.", flush=True)
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            simulated.run(self.seconds, recorder=recorder)
        except KeyboardInterrupt:
            pass
        finally:
            signal.signal(signal.SIGTERM, before)
        where = "fallen" if plant.fallen else "up"
        print(f"{plant.time:.1f} s, {simulated.late} late ticks, {end.received} commands: {where}")
        return OK


@dataclass(frozen=True, kw_only=True)
class DeployVerb(Output):
    """Run a scenario on a robot behind a link: preflight, ramp-in, scenario, ramp-out.

    The robot hangs in a hoist. Nothing is sent before the preflight has passed. Within three
    seconds the controller then takes over from position control, and stands for three more, in
    which the hoist is lowered. Enter, Ctrl-C and troubles of the watchdog damp the robot. Log,
    report and summary are those of `poise run`. Exit status: 0 all checks hold, 1 a check failed or
    the robot was damped, 2 bad input.

    example: poise deploy squat --robot g1 --interface eth0

    Attributes:
        scenario: a shipped scenario or a YAML file, whose pushes are left out.
        robot: the robot: g1.
        interface: network interface of the robot; lo for a simulated one.
        model: model of the robot, as it says in its mode_machine.
        tag: of the participants on the bus, that of a simulated robot.
        release: release the robot's own motion mode.
        priority: of the link's process under SCHED_FIFO, 1 to 99.
        controller: another controller than the file's.
        without_preflight: leave the preflight out, as for a simulated robot.
        motion: ask for the preflight's motions by hand.
        view: show the estimate in a window.
    """

    scenario: Annotated[Positional[str], arg(metavar="SCENARIO")] = "stand"
    robot: str = "g1"
    interface: str = "eth0"
    model: str = "g1_29dof_rev_1_0"
    tag: str = ""
    release: bool = False
    priority: int | None = None
    controller: str | None = None
    without_preflight: bool = False
    motion: bool = False
    view: bool = False

    def act(self) -> int:
        """Run the scenario."""
        from poise.apps import deployment as d, scenarios

        robot = _g1(self.robot)
        scenario = replace(scenarios.load_scenario(self.scenario), robot=self.robot)
        if self.controller is not None:
            plan = replace(scenario.controller, name=self.controller)
            scenario = replace(scenario, controller=plan)
        if scenario.pushes and not self.json:
            print(f"{len(scenario.pushes)} pushes are left out: nothing pushes the robot")
        gains = d.g1_gains(robot)
        link = d.connect_g1(
            robot,
            gains.check,
            interface=self.interface,
            model=self.model,
            tag=self.tag,
            release=self.release,
            priority=self.priority,
        )
        with output_folder(self.out, f"runs/deploy-{scenario.name}-{self.robot}") as folder:
            try:
                stage = d.stage_deployment(
                    scenario, robot, link, gains.check, gains.split, kp=gains.kp, kd=gains.kd
                )
                with _stopped_by_enter(stage), Bar("on the robot", " s", lines=not self.json) as bar:
                    run = d.deploy(stage, log=folder / scenarios.LOG, view=self.view, progress=bar)
            finally:
                link.close()
            summary = report_run(run, folder, self, video=False)
        self.show(summary)
        return 0 if run.ok else 1


def linked_plant(robot: Any, config: Any, *, interface: str, tag: str) -> Any:
    """Connect to a robot that an operator leads."""
    from poise.apps import deployment as d
    from poise.hardware import LinkBody

    _g1(robot.name)
    gains = d.g1_gains(robot)
    link = d.connect_g1(robot, gains.check, interface=interface, tag=tag)
    body = LinkBody(robot, link, gains.check, gains.split, kp=gains.kp, kd=gains.kd)
    return d.LinkedPlant(body, config)


def _g1(name: str) -> Any:
    from poise.robots import load_robot

    if name != "g1":
        raise ConfigurationError("no link to this robot", got=name, choices=("g1",))
    return load_robot(name)


@contextmanager
def _stopped_by_enter(stage: Any) -> Generator[None]:
    """Emergency stop by Enter, where a person sits at the terminal."""
    if sys.stdin.isatty():
        print("Enter is the emergency stop.", flush=True)

        def wait() -> None:
            sys.stdin.readline()
            stage.plant.body.watchdog.stop()

        threading.Thread(target=wait, name="poise emergency stop", daemon=True).start()
    yield
