"""`poise simulate` and `poise deploy`: both ends of a robot's bus."""

import signal
import sys
import threading
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional, arg

from poise._progress import Bar
from poise.cli._command import OK, Output, output_folder
from poise.cli._run import report_run
from poise.errors import ConfigurationError, RobotError


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
        from poise.sim import HoistedPlant, MotorConfig, PlantConfig, Recorder

        robot = _g1(self.robot)
        names = ("loss", "delay", "jitter", "reorder", "frozen", "dead", "begin")
        faults = d.FaultPlan(**{name: getattr(self, name) for name in names})
        config = PlantConfig(control_dt=0.002, motors=None if self.ideal else MotorConfig.g1())
        config = config.with_noise() if self.noise else config
        plant = HoistedPlant(robot, config, seed=self.seed)
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
        late = f"{simulated.late} late ticks, worst {1e3 * simulated.worst:.1f} ms"
        print(f"{plant.time:.1f} s, {late}, {end.received} commands: {where}")
        return OK


@dataclass(frozen=True, kw_only=True)
class DeployVerb(Output):
    """Run a scenario on a robot behind a link: preflight, ramp-in, scenario, ramp-out.

    The robot hangs in a hoist. Nothing is sent before the preflight has passed. The robot then
    takes its posture within three seconds, and is lowered onto its feet; after Enter the controller
    takes over within three more, and stands for three before the scenario begins. Without a
    terminal it counts as standing three seconds after it has its posture. Ctrl-C, Enter and
    troubles of the watchdog damp it. Log, report and summary are those of `poise run`. Exit status:
    0 all checks hold, 1 a check failed or the robot was damped, 2 bad input.

    example: poise deploy squat --robot g1 --interface eth0

    Attributes:
        scenario: a shipped scenario or a YAML file, whose pushes are left out.
        robot: the robot: g1, or a file with joints of that name, as of one with 23.
        interface: network interface of the robot; lo for a simulated one.
        model: model of the robot, as it says in its mode_machine: its name in unitree_ros, revision
            1.0 with as many joints by default.
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
    model: str | None = None
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
                if not self.without_preflight:
                    start = stage.plant.body.q_start
                    check_robot(robot, link, gains.check, start, motion=self.motion)
                _listen(stage.plant.body)
                with Bar("on the robot", " s", lines=not self.json) as bar:
                    run = d.deploy(stage, log=folder / scenarios.LOG, view=self.view, progress=bar)
            finally:
                link.close()
            summary = report_run(run, folder, self, video=False)
        self.show(summary)
        return 0 if run.ok else 1


def check_robot(robot: Any, link: Any, check: Any, start: Any, *, motion: bool) -> None:
    """Make the preflight and print it; an error where it fails."""
    from poise.hardware import preflight

    print("Preflight: the robot hangs, its feet in the air.", file=sys.stderr, flush=True)
    found = preflight(robot, link, check, start=start, motion=_ask if motion else None)
    print(found, file=sys.stderr, flush=True)
    if not found.ok:
        raise RobotError("the preflight failed", got=found.failed)


def _ask(move: Any) -> None:
    input(f"{move.prompt}; Enter begins.")


def linked_plant(
    robot: Any,
    config: Any,
    *,
    interface: str,
    tag: str,
    priority: int | None,
    without_preflight: bool,
) -> Any:
    """Connect to a robot that an operator leads."""
    from poise.apps import deployment as d
    from poise.hardware import LinkBody

    _require_g1(robot)
    gains = d.g1_gains(robot)
    link = d.connect_g1(robot, gains.check, interface=interface, tag=tag, priority=priority)
    body = LinkBody(robot, link, gains.check, gains.split, kp=gains.kp, kd=gains.kd)
    if not without_preflight:
        check_robot(robot, link, gains.check, body.q_start, motion=False)
    _listen(body)
    return d.LinkedPlant(body, config)


def _g1(name: str) -> Any:
    from poise.robots import load_robot

    robot = load_robot(name)
    _require_g1(robot)
    return robot


def _require_g1(robot: Any) -> None:
    from poise.robots import JointOrder

    strange = [j for j in robot.joint_names if j not in JointOrder.unitree_dds("g1").names]
    if strange:
        got = f"{robot.name} with {strange[0]}"
        raise ConfigurationError("no link to this robot", got=got, wanted="g1, or the file of one")


def _listen(body: Any) -> None:
    """Take Enter as the sign that the robot stands, then as the emergency stop."""
    if not sys.stdin.isatty():
        return
    stands = threading.Event()
    body.ready = stands.is_set
    print("The robot takes its posture: lower it until it stands on its feet, then press Enter.")
    print("After that Enter is the emergency stop, as Ctrl-C is at any time.", flush=True)

    def wait() -> None:
        sys.stdin.readline()
        stands.set()
        sys.stdin.readline()
        body.watchdog.stop()

    threading.Thread(target=wait, name="poise terminal", daemon=True).start()
