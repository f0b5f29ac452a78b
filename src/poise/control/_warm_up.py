"""`warm_up`: compilation ahead of use, in several processes where there are cores."""

import signal
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Any

from poise._compiled import (
    check_kept,
    code_folder,
    find_unkept,
    names_of,
    report_compiled,
    usable_cores,
)
from poise.control._controller import Controller
from poise.control._make import CONTROLLERS, ControllerPlan, check_plan, make_controller
from poise.control._reduced import ReducedController
from poise.control._whole_body import WholeBodyController
from poise.hqp import make_solver
from poise.robots import load_robot

_ROBOT = "humanoid33"
"""Machine code does not depend on the robot."""

Note = Callable[[int, int], None]
"""Callback with the number of functions that are compiled, and of all."""


@dataclass(frozen=True, kw_only=True)
class _Job:
    """Work of one process: no job needs the code of another."""

    code: tuple[str, ...]  # modules and packages of the functions that only this job compiles
    make: Callable[[], object]


def _make(plan: ControllerPlan, robot: str = _ROBOT) -> Controller:
    return make_controller(load_robot(robot), None, plan)


def _make_estimator() -> object:
    # Controllers without an estimator need not import it.
    from poise.estimation import StateEstimator

    return StateEstimator(load_robot(_ROBOT))


_SOLVER = _Job(code=("poise.hqp",), make=partial(make_solver, "direct"))
"""Needed by all controllers; it takes as long as all the rest."""

_ESTIMATOR = _Job(code=("poise.estimation",), make=_make_estimator)
"""Needed with every controller of a floating base."""

_JOBS = {
    # The strategies and the robot are such that they do not need the hierarchical solver.
    "reduced": _Job(
        code=(f"{__package__}._reduced", "poise.dynamics._reduction"),
        make=partial(_make, ControllerPlan(name="reduced", strategy="cascade")),
    ),
    "osf": _Job(
        code=(f"{__package__}._osf",), make=partial(_make, ControllerPlan(name="osf"), "upper17")
    ),
    "differential_ik": _Job(
        code=(f"{__package__}._differential_ik",),
        make=partial(_make, ControllerPlan(name="differential_ik")),
    ),
    "whole_body": _Job(
        code=(f"{__package__}._full_problem",),
        make=partial(_make, ControllerPlan(name="whole_body", strategy="cascade")),
    ),
}
"""By controller, those that take longest first."""


@dataclass(frozen=True, kw_only=True)
class WarmUp:
    """Result of `warm_up`."""

    controllers: tuple[str, ...]  # that are ready now
    functions: int  # that had to be compiled
    seconds: float  # duration [s]
    folder: str  # of the machine code


def warm_up(
    controllers: Sequence[str] = tuple(CONTROLLERS),
    *,
    processes: int | None = None,
    note: Note | None = None,
    others: Sequence[Callable[[], object]] = (),
) -> WarmUp:
    """Compile the functions of controllers and the estimator that are not kept yet."""
    begin, plans = perf_counter(), _plans(controllers)
    folder = code_folder()
    skipped = tuple(c for name, job in _JOBS.items() if name not in controllers for c in job.code)
    left = find_unkept(skipped)
    awaited, done = names_of(left), set[str]()

    def note_compiled(name: str) -> None:
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
        _share_out(jobs, processes, note_compiled)
    # Functions that all need, that no process compiled, and all where none could be started.
    with report_compiled(note_compiled):
        _make_estimator()
        for plan in plans:
            controller = _make(plan)
            # Functions that no tick needs compile at their first use.
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
    """List every controller with each of its strategies."""
    return [
        ControllerPlan(name=name, strategy=strategy)
        for name in controllers
        for strategy in check_plan(ControllerPlan(name=name)).strategies
    ]


def _share_out(jobs: Sequence[_Job], processes: int, note_compiled: Callable[[str], None]) -> None:
    """Run the jobs in processes, as far as processes can be started."""
    # Controllers alone need no processes.
    import multiprocessing
    from concurrent import futures

    context = multiprocessing.get_context("spawn")
    names: Any = context.SimpleQueue()
    with (
        suppress(OSError, futures.BrokenExecutor),
        futures.ProcessPoolExecutor(processes, context, _listen, (names,)) as pool,
    ):
        running = {pool.submit(_run, job) for job in jobs}
        try:
            while running:
                finished, running = futures.wait(running, 0.1, futures.FIRST_COMPLETED)
                while not names.empty():
                    note_compiled(names.get())
                for one in finished:
                    one.result()
        except BaseException:
            # Ctrl-C included.
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        while not names.empty():
            note_compiled(names.get())


_names: Any = None
"""In a process that compiles: queue of names of functions."""


def _listen(names: Any) -> None:
    global _names
    # Ctrl-C ends it silently: its parent reports.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _names = names


def _run(job: _Job) -> None:
    with report_compiled(_names.put):
        job.make()
