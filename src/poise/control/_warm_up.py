"""`warm_up`: compiles ahead what control needs, in several processes where there are cores."""

import multiprocessing
import signal
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Any

from poise._compiled import (
    check_kept,
    code_folder,
    compiling_told,
    find_unkept,
    names_of,
    usable_cores,
)
from poise.control._controller import Controller
from poise.control._make import CONTROLLERS, ControllerPlan, check_plan, make_controller
from poise.control._reduced import ReducedController
from poise.control._whole_body import WholeBodyController
from poise.estimation import StateEstimator
from poise.hqp import make_solver
from poise.robots import load_robot

_HERE = __name__.rpartition(".")[0]

_ROBOT = "humanoid33"
"""Machine code does not depend on the robot."""

Note = Callable[[int, int], None]
"""Told how many functions are compiled, and of how many."""


@dataclass(frozen=True, kw_only=True)
class _Job:
    """What one process compiles: no job needs the code of another.

    Attributes:
        code: modules and packages of the functions that only this job compiles.
        make: makes what is compiled by being made.
    """

    code: tuple[str, ...]
    make: Callable[[], object]


def _make(plan: ControllerPlan, robot: str = _ROBOT) -> Controller:
    return make_controller(load_robot(robot), None, plan)


def _make_estimator() -> StateEstimator:
    return StateEstimator(load_robot(_ROBOT))


_SOLVER = _Job(code=("poise.hqp",), make=partial(make_solver, "direct"))
"""All controllers need it, and it takes as long as all the rest."""

_ESTIMATOR = _Job(code=("poise.estimation",), make=_make_estimator)
"""Whatever the controller, a robot does not know its base."""

_JOBS = {
    # The strategies and the robot are such that they do not need the hierarchical solver.
    "reduced": _Job(
        code=(f"{_HERE}._reduced", "poise.dynamics._reduction"),
        make=partial(_make, ControllerPlan(name="reduced", strategy="cascade")),
    ),
    "osf": _Job(
        code=(f"{_HERE}._osf",), make=partial(_make, ControllerPlan(name="osf"), "upper17")
    ),
    "differential_ik": _Job(
        code=(f"{_HERE}._differential_ik",),
        make=partial(_make, ControllerPlan(name="differential_ik")),
    ),
    "whole_body": _Job(
        code=(f"{_HERE}._full_problem",),
        make=partial(_make, ControllerPlan(name="whole_body", strategy="cascade")),
    ),
}
"""By controller, those that take longest first."""


@dataclass(frozen=True, kw_only=True)
class WarmUp:
    """What was done.

    Attributes:
        controllers: that are ready now.
        functions: how many had to be compiled.
        seconds: that it took [s].
        folder: where the machine code is kept.
    """

    controllers: tuple[str, ...]
    functions: int
    seconds: float
    folder: str


def warm_up(
    controllers: Sequence[str] = tuple(CONTROLLERS),
    *,
    processes: int | None = None,
    note: Note | None = None,
    others: Sequence[Callable[[], object]] = (),
) -> WarmUp:
    """Compiles all that controllers and the estimator need, as far as it is not kept yet."""
    begin, plans = perf_counter(), _plans(controllers)
    folder = code_folder()
    skipped = tuple(c for name, job in _JOBS.items() if name not in controllers for c in job.code)
    left = find_unkept(skipped)
    awaited, done = names_of(left), set[str]()

    def told(name: str) -> None:
        # Numba compiles a few functions of its own, too.
        if name in awaited:
            done.add(name)
            if note is not None:
                note(len(done), len(awaited))

    modules = {function.py_func.__module__ for function in left}
    jobs = [_SOLVER, _ESTIMATOR, *(job for name, job in _JOBS.items() if name in controllers)]
    jobs = [job for job in jobs if any(module.startswith(job.code) for module in modules)]
    processes = min(usable_cores() if processes is None else processes, len(jobs))
    if processes > 1:
        _share_out(jobs, processes, told)
    # What all of them need, what no process compiled, and all where none could be started.
    with compiling_told(told):
        _make_estimator()
        for plan in plans:
            controller = _make(plan)
            # What no tick needs compiles when it is first asked for.
            if isinstance(controller, WholeBodyController) and plan.strategy == "direct":
                controller.solve_batch([])
            if isinstance(controller, ReducedController):
                controller.strategy.current.reduced.update(controller.dynamics)
        for make in others:
            make()
    check_kept(done)
    return WarmUp(
        controllers=tuple(controllers),
        functions=len(done),
        seconds=perf_counter() - begin,
        folder=folder,
    )


def _plans(controllers: Sequence[str]) -> list[ControllerPlan]:
    """Every controller in every way that it can solve."""
    return [
        ControllerPlan(name=name, strategy=strategy)
        for name in controllers
        for strategy in check_plan(ControllerPlan(name=name)).strategies
    ]


def _share_out(jobs: Sequence[_Job], processes: int, told: Callable[[str], None]) -> None:
    """Has processes do the jobs, as far as processes can be started."""
    context = multiprocessing.get_context("spawn")
    names: Any = context.SimpleQueue()
    with (
        suppress(OSError, BrokenProcessPool),
        ProcessPoolExecutor(processes, context, _listen, (names,)) as pool,
        _ended(pool),
    ):
        running = {pool.submit(_run, job) for job in jobs}
        while running:
            finished, running = wait(running, 0.1, FIRST_COMPLETED)
            while not names.empty():
                told(names.get())
            for one in finished:
                one.result()
        while not names.empty():
            told(names.get())


@contextmanager
def _ended(pool: ProcessPoolExecutor) -> Generator[None]:
    """Ends what waits in a pool when something goes wrong, Ctrl-C included."""
    try:
        yield
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise


_names: Any = None
"""In a process that compiles: where names of functions go."""


def _listen(names: Any) -> None:
    global _names
    # Ctrl-C ends it without words: the process that asked for it says something.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _names = names


def _run(job: _Job) -> None:
    with compiling_told(_names.put):
        job.make()
