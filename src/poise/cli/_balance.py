"""`poise balance`: balance for another program that moves the arms."""

import signal
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import arg

from poise.cli._command import FAILED, OK
from poise.cli._deploy import linked_plant


@dataclass(frozen=True, kw_only=True)
class BalanceVerb:
    """Keep a robot standing and walking while another program moves its arms and head, by ZeroMQ.

    The program sends JSON with joint or hand targets and a velocity, and gets the state; see
    examples/24_balance_client.py. Without --link the robot is simulated. Ctrl-C ends.
    Exit status: 0 the robot is up, 1 it fell or was damped, 2 bad input.

    example: poise balance --link eth0

    Attributes:
        robot: a humanoid: a name that `poise robots` lists, or a file; with --link g1.
        link: interface of a robot behind a link, as eth0, or lo for a simulated one.
        tag: of the participants on its bus.
        priority: of the link's process under SCHED_FIFO, 1 to 99.
        without_preflight: leave its preflight out.
        host: address of this machine on which the service listens.
        port: of targets, and the one before that of states.
        seconds: end after so many seconds.
        out: folder for the log.
    """

    robot: str = "g1"
    link: str | None = None
    tag: str = ""
    priority: int | None = None
    without_preflight: bool = False
    host: str = "127.0.0.1"
    port: int = 5570
    seconds: float = inf
    out: Annotated[str | None, arg(metavar="DIR")] = None

    def act(self) -> int:
        """Run until it is ended."""
        from poise.apps.balance import BalanceLeader, BalanceServer
        from poise.apps.deployment import FLUSH
        from poise.estimation import PayloadEstimator, StateEstimator
        from poise.robots import load_robot
        from poise.sim import Plant, PlantConfig, Recorder, RecorderConfig

        robot, config = load_robot(self.robot), PlantConfig(control_dt=0.002, self_contact=True)
        observers: list[Any] = []
        if self.out is not None:
            Path(self.out).mkdir(parents=True, exist_ok=True)
            recording = RecorderConfig(flush_dt=FLUSH, keep=False)
            observers = [Recorder(Path(self.out) / "log.mcap", config=recording)]
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)
        leader = BalanceLeader(robot, dt=config.control_dt)
        with BalanceServer(leader, port=self.port, host=self.host) as server:
            estimator = StateEstimator(robot, payload=PayloadEstimator(robot))
            plant: Plant = Plant(robot, config)
            if self.link is not None:
                server.run(plant, estimator=estimator, duration=0.1)  # compiles what is missing
                estimator.reset()
                server.leader = BalanceLeader(robot, dt=config.control_dt)
                plant = linked_plant(
                    robot,
                    config,
                    interface=self.link,
                    tag=self.tag,
                    priority=self.priority,
                    without_preflight=self.without_preflight,
                )
            print(f"{robot.name}: targets to {server.targets}, states from {server.states}")
            print("Ctrl-C ends.", flush=True)
            paced, seconds = self.link is None, None if self.seconds == inf else self.seconds
            try:
                server.run(
                    plant, observers=observers, estimator=estimator, duration=seconds, paced=paced
                )
            except KeyboardInterrupt:
                pass
            finally:
                signal.signal(signal.SIGTERM, before)
                if self.link is not None:
                    plant.body.close()
        trouble = f"; {plant.trouble}" if plant.trouble else ""
        print(f"{plant.time:.1f} s, {server.leader.refused} messages refused{trouble}")
        return FAILED if trouble else OK
