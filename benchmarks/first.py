"""`bench_first`: the first controller from an empty cache, and the one of a second process.

Every measurement is a process of its own, so that nothing is loaded that it does not load itself.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.commands import Bench
from benchmarks.recording import Progress
from benchmarks.result import Figure, Result
from poise.control import CONTROLLERS
from poise.errors import ConfigurationError, PoiseError, UnknownNameError

EMPTY_S = 25.0
"""Processor time that the first controller from an empty cache takes at most [s]."""

SECOND_S = 0.8
"""Processor time that the import and the first controller of a second process take at most [s]."""

_CHILD = """
import json, resource, sys, time
def spent():
    own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF,
                                                       resource.RUSAGE_CHILDREN))
    return sum(use.ru_utime + use.ru_stime for use in (own, others))
times = [spent()]
import poise
from poise.control import ControllerPlan, make_controller
times.append(spent())
robot = poise.load_robot(sys.argv[1])
times.append(spent())
begin = time.perf_counter()
controller = make_controller(robot, None, ControllerPlan(name=sys.argv[2]))
wall = time.perf_counter() - begin
times.append(spent())
state = poise.RobotState(robot.q_home, 0.0 * robot.model.armature)
before = time.thread_time()
status = controller.step(state).status
tick = time.thread_time() - before
print(json.dumps({"times": times, "wall": wall, "tick": tick, "status": status.value}))
"""


@dataclass(frozen=True, kw_only=True)
class FirstBench(Bench):
    """Time import and first controller, from an empty cache and in a second process.

    example: python -m benchmarks first --controller osf
    """

    robot: str = "humanoid33"  # name or path of a robot
    controller: str = "whole_body"  # one of `CONTROLLERS`
    runs: int = 10  # second processes

    def __post_init__(self) -> None:
        if self.controller not in CONTROLLERS:
            raise UnknownNameError(
                "no such controller", got=self.controller, choices=tuple(CONTROLLERS)
            )
        if self.runs < 1:
            raise ConfigurationError("nothing to time", got=self.runs, wanted="at least one run")

    def act(self) -> int:
        """Time and print."""
        return self.show(bench_first, first_figures, unit=" processes")


@dataclass(frozen=True, kw_only=True)
class FirstResult(Result):
    """One kind of process; processor times unless it says otherwise."""

    process: str  # "empty cache", or "second" for those that find the machine code
    robot: str  # that was loaded
    controller: str  # that was made
    runs: int  # processes; of several the 10th percentile is given
    import_s: float  # `import poise` [s]
    robot_s: float  # loading the robot [s]
    controller_s: float  # making the controller [s]
    controller_wall_s: float  # the same by the clock on the wall [s]
    tick_us: float  # its first tick, of its thread [us]
    both_s: float  # import and controller together [s]


def bench_first(plan: FirstBench, progress: Progress | None = None) -> list[FirstResult]:
    """Makes a controller where nothing is compiled, then again in further processes."""
    found: list[dict[str, float]] = []
    # The first process of all leaves Python's own compiled files.
    _start(["-c", "import poise.control"], {})
    with tempfile.TemporaryDirectory() as folder:
        for count in range(1 + plan.runs):
            found.append(_run(plan, folder))
            if progress is not None:
                progress(float(count), float(plan.runs))
    return [
        _result(plan, "empty cache", found[:1]),
        _result(plan, "second", found[1:]),
    ]


def _run(plan: FirstBench, cache: str) -> dict[str, float]:
    """Seconds of the parts of one process."""
    out = _start(["-c", _CHILD, plan.robot, plan.controller], {"NUMBA_CACHE_DIR": cache})
    answer = json.loads(out.splitlines()[-1])
    start, imported, loaded, made = answer["times"]
    parts = {"import": imported - start, "robot": loaded - imported, "controller": made - loaded}
    both = parts["import"] + parts["controller"]
    return {**parts, "both": both, "wall": answer["wall"], "tick": answer["tick"]}


def _start(command: Sequence[str], environment: dict[str, str]) -> str:
    """Output of a process of Python."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(
        [sys.executable, *command],
        env={**kept, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise PoiseError("the process failed", got=done.stderr.strip().splitlines()[-1])
    return done.stdout


def _result(plan: FirstBench, process: str, found: Sequence[dict[str, float]]) -> FirstResult:
    tenth = {part: float(np.percentile([run[part] for run in found], 10.0)) for part in found[0]}
    return FirstResult(
        process=process,
        robot=plan.robot,
        controller=plan.controller,
        runs=len(found),
        import_s=round(tenth["import"], 3),
        robot_s=round(tenth["robot"], 3),
        controller_s=round(tenth["controller"], 3),
        controller_wall_s=round(tenth["wall"], 3),
        tick_us=round(1e6 * tenth["tick"], 1),
        both_s=round(tenth["both"], 3),
    )


def first_figures(results: Sequence[FirstResult]) -> list[Figure]:
    """What must hold of them."""
    figures: list[Figure] = []
    for result in results:
        empty = result.process == "empty cache"
        bound = EMPTY_S if empty else SECOND_S
        ours = result.controller_s if empty else result.both_s
        what = "first controller" if empty else "import and first controller"
        name = f"{result.process}: {what}, {result.controller} on {result.robot} [s]"
        figures.append(Figure.at_most(name, ours, bound))
    return figures
