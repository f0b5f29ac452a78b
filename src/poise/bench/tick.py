"""`bench_tick`: times a controller's tick by phase, all methods interleaved in one run."""

import gc
from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from poise.bench.collector import collector_paused
from poise.bench.methods import REFERENCE, default_methods, parse_method
from poise.bench.peers import PEERS, PeerProcess
from poise.bench.recording import Progress, Recording, record_run
from poise.bench.result import TickResult, time_statistics
from poise.bench.stances import STACKS, STANCES, check_biped
from poise.bench.subject import Subject
from poise.control import CONTROLLERS
from poise.errors import ConfigurationError, UnknownNameError
from poise.hqp import make_solver
from poise.robots import load_robot

WARM_UP = 30
"""Ticks before those that count: caches, workspaces and warm starts settle."""

BATCH = 20
"""A peer, which is another process, takes its turn after this many ticks of our own."""

Guest = Subject | PeerProcess
"""Who is timed a batch at a time: peers, and `direct` beside them as their reference."""


@dataclass(frozen=True, kw_only=True)
class TickBench:
    """What to time; checked when made.

    Attributes:
        robot: name or path of a biped.
        contacts: "double" or "single" support.
        controller: one of `CONTROLLERS`.
        stacks: "table1", "default", or both.
        methods: names of the controller's methods, its usual ones when None; the whole-body
            controller's `direct` is timed in any case, as the reference.
        peers: Python interpreters of other packages' environments by name, see `PEERS`.
        ticks: timed ticks of each method.
    """

    robot: str = "humanoid33"
    contacts: str = "double"
    controller: str = "whole_body"
    stacks: tuple[str, ...] = STACKS
    methods: tuple[str, ...] | None = None
    peers: Mapping[str, Path] = field(default_factory=dict)
    ticks: int = 500

    def __post_init__(self) -> None:
        _check_choice("unknown contacts", [self.contacts], STANCES)
        _check_choice("unknown stack", self.stacks, STACKS)
        _check_choice("no such controller", [self.controller], tuple(CONTROLLERS))
        _check_choice("unknown peer", tuple(self.peers), PEERS)
        for name in self.methods or ():
            parse_method(self.controller, name)
        if self.ticks < 1:
            raise ConfigurationError("nothing to time", got=self.ticks, wanted="at least one tick")
        for name, interpreter in self.peers.items():
            if not interpreter.is_file():
                raise ConfigurationError(
                    f"the Python interpreter of peer {name!r} does not exist",
                    got=str(interpreter),
                    wanted="a path such as peers/tsid/bin/python",
                )


def bench_tick(plan: TickBench, progress: Progress | None = None) -> list[TickResult]:
    """Records a moving run, then times every method on its states, tick by tick in turn.

    The order rotates from tick to tick, so that no method always runs after the same other one.
    Peers are other processes and take their turn a batch at a time; `direct` is timed once more in
    the same way, as their reference. The garbage collector runs between batches, never inside a
    timed tick.

    Args:
        plan: what to time.
        progress: told how many of all ticks are done; a tick is one pass through all methods.

    Returns:
        One result a stack and method, `direct` first.

    Raises:
        PoiseError: bad input, a backend or peer that cannot run, or a robot that fell.
    """
    robot = load_robot(plan.robot)
    check_biped(robot)
    ticks = WARM_UP + plan.ticks
    wanted = default_methods(plan.controller) if plan.methods is None else plan.methods
    methods = list(
        dict.fromkeys((REFERENCE, *(parse_method(plan.controller, name) for name in wanted)))
    )
    results: list[TickResult] = []
    for method in methods:
        # A backend that is missing is found before the run.
        if method.backend is not None:
            make_solver(method.strategy, method.backend)
    recording = record_run(robot, plan.contacts, ticks)
    for i, kind in enumerate(plan.stacks):
        with ExitStack() as stack:
            subjects = [Subject(recording, kind, m) for m in methods]
            peers = [
                stack.enter_context(PeerProcess(name, python, recording, kind))
                for name, python in plan.peers.items()
            ]
            direct = Subject(recording, kind, methods[0])
            guests = [direct, *peers] if peers else []
            for done in _interleave(subjects, guests, ticks):
                if progress is not None:
                    progress(float(i * ticks + done), float(len(plan.stacks) * ticks))
            results += _results(recording, kind, subjects, guests)
    return results


def _interleave(subjects: Sequence[Subject], guests: Sequence[Guest], ticks: int) -> Generator[int]:
    """Times everything; yields the number of ticks done, a batch at a time."""
    with collector_paused():
        for first in range(0, ticks, BATCH):
            count = min(BATCH, ticks - first)
            for tick in range(first, first + count):
                for turn in range(len(subjects)):
                    subjects[(tick + turn) % len(subjects)].tick(tick)
            for turn in range(len(guests)):
                guests[(first // BATCH + turn) % len(guests)].run(first, count)
            gc.collect()
            yield first + count


def _results(
    recording: Recording,
    kind: str,
    subjects: Sequence[Subject],
    guests: Sequence[Guest],
) -> list[TickResult]:
    robot = recording.robot
    results: list[TickResult] = []
    for schedule, timed in (("tick", subjects), ("batch", guests)):
        for one in timed:
            residual, relaxed, missed = one.accuracy(WARM_UP)
            variables, rows = one.size()
            results.append(
                TickResult(
                    robot=robot.name,
                    joints=robot.nj,
                    controller=one.name,
                    solver=one.solver,
                    stack=kind,
                    contacts=recording.stance,
                    schedule=schedule,
                    variables=variables,
                    rows=rows,
                    residual_max=residual,
                    relaxed_ticks=relaxed,
                    missed_ticks=missed,
                    **time_statistics(one.times(WARM_UP), timed[0].times(WARM_UP)),
                )
            )
    return results


def _check_choice(what: str, names: Sequence[str], choices: Sequence[str]) -> None:
    for name in names:
        if name not in choices:
            raise UnknownNameError(what, got=name, choices=choices)
