"""`bench_growth`: how a tick grows with joints, levels, tasks and contacts, one at a time."""

import gc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import thread_time
from typing import Any

import numpy as np
from jaxtyping import Float64

from benchmarks.recording import Progress
from benchmarks.result import Result, text_table
from poise.control import WholeBodyController
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.robots import Robot, load_robot
from poise.stack import (
    BalanceLimit,
    ComTask,
    Contact,
    FrameTask,
    PointContact,
    PostureTask,
    Stack,
    SurfaceContact,
    Task,
    default_stack,
)

JOINTS = (20, 28, 33, 41, 50, 60)
"""Actuated joints of the robots; the others vary on `ROBOT`."""

ROBOT = "humanoid33"

_BATCH = 20
"""Ticks that a controller does in a row; so it finds the caches as in a loop of its own, but for
the first two, which do not count."""

_ORIENTATIONS = ("torso", "left_hand", "right_hand")
"""Frames that are turned by tasks of their own."""


@dataclass(frozen=True, kw_only=True)
class GrowthBench:
    """What to time.

    Attributes:
        ticks: of each controller.
    """

    ticks: int = 400


@dataclass(frozen=True, kw_only=True)
class GrowthResult(Result):
    """One controller.

    Attributes:
        of: what varies: "joints", "levels", "tasks" or "contacts".
        count: how many there are.
        variables: unknowns of the problem.
        rows: two-sided rows, finite bounds on single unknowns among them.
        p10_us: 10th percentile of the tick's processor time [us].
        p50_us: its median [us].
        ratio: `p10_us` by that of the fewest.
        missed_ticks: ticks that fell back to a safe command.
    """

    of: str
    count: int
    variables: int
    rows: int
    p10_us: float
    p50_us: float
    ratio: float
    missed_ticks: int


def bench_growth(plan: GrowthBench, progress: Progress | None = None) -> list[GrowthResult]:
    """Times controllers that differ in one number, in turn every few ticks.

    Args:
        plan: what to time.
        progress: told how many of the controllers are done.

    Raises:
        ConfigurationError: fewer ticks than a batch.
    """
    if plan.ticks < _BATCH:
        raise ConfigurationError("too few ticks", got=plan.ticks, wanted=f">= {_BATCH} ticks")
    robot = load_robot(ROBOT)
    groups: dict[str, dict[int, Callable[[], tuple[Robot, Stack]]]] = {
        "joints": {n: lambda n=n: _default(load_robot(f"humanoid{n}")) for n in JOINTS},
        "levels": {n: lambda n=n: (robot, _with_levels(robot, n)) for n in range(1, 7)},
        "tasks": {n: lambda n=n: (robot, _with_tasks(robot, n)) for n in range(1, 7)},
        "contacts": {n: lambda n=n: (robot, _with_contacts(robot, n)) for n in range(1, 5)},
    }
    results: list[GrowthResult] = []
    for done, (of, makers) in enumerate(groups.items()):
        controllers = {n: WholeBodyController(*make()) for n, make in makers.items()}
        results += _timed(of, controllers, plan.ticks)
        if progress is not None:
            progress(float(done + 1), float(len(groups)))
    return results


def _default(robot: Robot) -> tuple[Robot, Stack]:
    return robot, default_stack(robot)


def _feet(robot: Robot) -> list[Contact]:
    return [SurfaceContact(sole) for sole in robot.soles]


def _with_levels(robot: Robot, count: int) -> Stack:
    """Six tasks in so many levels: the same rows, in other order."""
    left, right = robot.hands
    tasks: list[Task] = [
        ComTask(),
        FrameTask(robot.pelvis, "orientation"),
        FrameTask(left),
        FrameTask(right),
        FrameTask(robot.torso, "orientation"),
        PostureTask(),
    ]
    # The last level gets all that is left.
    levels = [[task] for task in tasks[: count - 1]]
    return _stack(_feet(robot), [*levels, tasks[count - 1 :]])


def _stack(contacts: Sequence[Contact], levels: Sequence[Sequence[Task]]) -> Stack:
    """Without limits that are levels of their own, beside those that are counted."""
    return Stack(
        contacts,
        levels,
        balance_limit=BalanceLimit(enabled=False),
    )


def _with_tasks(robot: Robot, count: int) -> Stack:
    """So many tasks of three rows between balance and posture."""
    left, right = robot.hands
    between: list[Task] = [
        FrameTask(left, "position"),
        FrameTask(right, "position"),
        *(FrameTask(name, "orientation") for name in (robot.torso, left, right)),
        FrameTask(robot.torso, "position"),
    ]
    return _stack(_feet(robot), [[ComTask()], between[:count], [PostureTask()]])


def _with_contacts(robot: Robot, count: int) -> Stack:
    """A foot, both, and one hand or both, which touch a point where they are."""
    hands: list[Contact] = [PointContact(hand) for hand in robot.hands]
    levels: list[list[Task]] = [
        [ComTask()],
        [FrameTask(robot.torso, "orientation")],
        [PostureTask()],
    ]
    return _stack([*_feet(robot), *hands][:count], levels)


def _states(robot: Robot, count: int) -> list[RobotState]:
    """A slow motion of everything about the home posture."""
    import pinocchio as pin

    rng = np.random.default_rng(0)
    sine, cosine = 0.02 * rng.normal(size=(2, robot.nv))
    states: list[RobotState] = []
    for k in range(count):
        t = 0.002 * k
        moved = sine * np.sin(3.0 * t) + cosine * (np.cos(2.0 * t) - 1.0)
        v = 3.0 * sine * np.cos(3.0 * t) - 2.0 * cosine * np.sin(2.0 * t)
        states.append(RobotState(pin.integrate(robot.model, robot.q_home, moved), v, time=t))
    return states


def _timed(of: str, controllers: dict[int, WholeBodyController], ticks: int) -> list[GrowthResult]:
    """Times the controllers of one group in turn."""
    states = {n: _states(controller.robot, ticks) for n, controller in controllers.items()}
    seconds = {n: np.zeros(ticks) for n in controllers}
    missed = dict.fromkeys(controllers, 0)
    for begin in range(0, ticks, _BATCH):
        gc.collect()
        for n, controller in controllers.items():
            for i in range(begin, min(begin + _BATCH, ticks)):
                start = thread_time()
                command = controller.step(states[n][i])
                seconds[n][i] = thread_time() - start
                missed[n] += not command.status.ok
    counted = np.arange(ticks) % _BATCH >= 2
    least = min(controllers)
    first = float(np.percentile(seconds[least][counted], 10.0))
    return [
        _result(of, n, c, seconds[n][counted], first, missed[n]) for n, c in controllers.items()
    ]


def _result(
    of: str,
    count: int,
    controller: WholeBodyController,
    seconds: Float64[np.ndarray, " ticks"],
    first: float,
    missed: int,
) -> GrowthResult:
    variables, rows = controller.size
    p10, p50 = (float(np.percentile(seconds, p)) for p in (10.0, 50.0))
    return GrowthResult(
        of=of,
        count=count,
        variables=variables,
        rows=rows,
        p10_us=round(1e6 * p10, 1),
        p50_us=round(1e6 * p50, 1),
        ratio=round(p10 / first, 2),
        missed_ticks=missed,
    )


def format_growth_table(results: Sequence[GrowthResult]) -> str:
    """Times by what varies, for a terminal."""
    heads = ("variables", "rows", "p10 [us]", "p50 [us]", "ratio", "missed")
    rows: list[tuple[str, list[str], str]] = []
    for r in results:
        cells: list[Any] = [r.variables, r.rows, f"{r.p10_us:.0f}", f"{r.p50_us:.0f}"]
        rows.append(
            (f"{r.count} {r.of}", [*map(str, cells), f"{r.ratio:.2f}", str(r.missed_ticks)], "")
        )
    return "\n".join(text_table(heads, rows))
