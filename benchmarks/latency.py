"""`bench_latency`: from a pose that a client sends over the websocket to the robot's command."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.commands import Bench
from benchmarks.recording import Progress
from benchmarks.result import Figure, Result
from poise.apps.live import LiveSession
from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, VELOCITY_TELEOP_PLANT
from poise.errors import ConfigurationError, PoiseError, UnknownNameError
from poise.robots import load_robot

BOUND_MS = 20.0
"""From pose to command at most, 99th percentile, on a machine with nothing else to do [ms]."""

STAGES = ("sent to arrived", "arrived to sampled", "sampled to commanded", "sent to commanded")
"""Between the stages, and all of it."""

_PLANTS = {"velocity": VELOCITY_TELEOP_PLANT, "torque": TORQUE_TELEOP_PLANT}

_WARM_UP = 20
"""Messages before those that count."""

_PATIENCE = 120.0

# A process of its own, as a browser is: the robot's has no time to spare for a client.
_CLIENT = """
import json, sys, threading, time
from websockets.sync.client import connect
url, count, rate = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
with connect(url, proxy=None, max_queue=None) as socket:
    def hear():
        try:
            for _ in socket:
                pass
        except Exception:
            pass
    threading.Thread(target=hear, daemon=True).start()
    begin = time.monotonic()
    for k in range(count):
        time.sleep(max(0.0, begin + k / rate - time.monotonic()))
        sample = {"do": "drive", "time": time.monotonic(), "lift": [False, k % 300 > 150]}
        socket.send(json.dumps(sample))
"""


@dataclass(frozen=True, kw_only=True)
class LatencyBench(Bench):
    """Time an operator's message over the websocket, stage by stage, until the robot's command.

    example: python -m benchmarks latency --actuation torque
    """

    robot: str = "biped20"  # name or path of a biped
    actuation: str = "velocity"  # what is commanded, "velocity" or "torque"
    messages: int = 1000  # that count
    rate: float = 60.0  # at which a client sends [Hz]

    def __post_init__(self) -> None:
        if self.actuation not in _PLANTS:
            raise UnknownNameError("no such actuation", got=self.actuation, choices=tuple(_PLANTS))
        if self.messages < 1 or not 0.0 < self.rate <= 1000.0:
            raise ConfigurationError(
                "nothing to time",
                got=(self.messages, self.rate),
                wanted="at least one message, at up to 1000 Hz",
            )

    def act(self) -> int:
        """Time and print."""
        return self.show(bench_latency, latency_figures, unit=" messages")


@dataclass(frozen=True, kw_only=True)
class LatencyResult(Result):
    """Delays of messages from one stage to the next."""

    robot: str  # name of the robot
    actuation: str  # what is commanded
    stage: str  # one of `STAGES`
    p50_ms: float  # median [ms]
    p99_ms: float  # 99th percentile [ms]
    max_ms: float  # longest [ms]
    messages: int  # that arrived and were not overtaken
    # Robot time over clock time: below 1 the machine is too slow for the robot
    real_time_factor: float


def bench_latency(plan: LatencyBench, progress: Progress | None = None) -> list[LatencyResult]:
    """Runs a live session, and a client in a process of its own that lifts a foot now and then.

    Both read the machine's monotonic clock. Stages: the client sends a message; it has arrived; the
    robot's loop takes it at a tick's beginning; the controller has its command.
    """
    robot = load_robot(plan.robot)
    wanted = plan.messages + _WARM_UP
    with (
        tempfile.TemporaryDirectory() as folder,
        LiveSession(robot, folder, plant=_PLANTS[plan.actuation]) as session,
    ):
        # In the first ticks the processor has yet to find everything.
        time.sleep(1.0)
        began, first = time.monotonic(), session.loop.plant.time
        _send(session, wanted, plan.rate, progress)
        factor = (session.loop.plant.time - first) / (time.monotonic() - began)
        stages = np.array(session.inputs.stages)[_WARM_UP:]
    if len(stages) < 0.5 * plan.messages:
        raise PoiseError(f"of {plan.messages} messages {len(stages)} were taken")
    spans = 1e3 * np.column_stack((np.diff(stages, axis=1), stages[:, -1] - stages[:, 0]))
    return [
        LatencyResult(
            robot=robot.name,
            actuation=plan.actuation,
            stage=stage,
            p50_ms=float(np.median(span)),
            p99_ms=float(np.percentile(span, 99.0)),
            max_ms=float(span.max()),
            messages=len(span),
            real_time_factor=factor,
        )
        for stage, span in zip(STAGES, spans.T, strict=True)
    ]


def latency_figures(results: Sequence[LatencyResult]) -> list[Figure]:
    """What must hold of them."""
    whole = results[-1]
    name = f"{whole.stage}, {whole.robot}, {whole.actuation}"
    spans = {"median": whole.p50_ms, "99th percentile": whole.p99_ms}
    return [Figure.at_most(f"{name}: {what} [ms]", ours, BOUND_MS) for what, ours in spans.items()]


def _send(session: LiveSession, count: int, rate: float, progress: Progress | None) -> None:
    """Has a client send messages, and waits for its end."""
    token, port = session.front.seat.token, session.front.port
    url = f"ws://127.0.0.1:{port}/control?token={token}"
    end = time.monotonic() + count / rate + _PATIENCE
    with subprocess.Popen([sys.executable, "-c", _CLIENT, url, str(count), str(rate)]) as client:
        while client.poll() is None:
            if time.monotonic() > end:
                client.kill()
            if progress is not None:
                progress(float(len(session.inputs.stages)), float(count))
            time.sleep(0.2)
    if client.returncode != 0:
        raise PoiseError("the client has failed")
    # What was sent last, too.
    time.sleep(0.1)
