"""`bench_tick`: times a controller's tick by phase, all methods interleaved in one run.

`peer_figures`: how many times longer the tick of the paper's own code takes.
"""

import os
import sys
from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import arg

from benchmarks.clocked import Subject, batches, in_turn
from benchmarks.commands import Bench, MaybeWords, read_by, words_of
from benchmarks.methods import BY_PROGRAMS, DIRECT, Method, parse_method, timed_methods
from benchmarks.peers.process import (
    PROGRAMS,
    TORQUE_PEERS,
    VELOCITY_PEERS,
    PeerProcess,
    how_to_install,
    peer_variable,
)
from benchmarks.recording import STACKS, STANCES, Progress, Recording, check_biped, record_run
from benchmarks.result import Figure, TickResult, Ticks, format_table, time_statistics
from poise.control import CONTROLLERS
from poise.errors import ConfigurationError, UnknownNameError
from poise.hqp import make_solver
from poise.robots import load_robot

WARM_UP = 30
"""Ticks before those that count: caches, workspaces and warm starts settle."""

_COUNTED = slice(WARM_UP, None)

BATCH = 20
"""A peer, which is another process, takes its turn after this many ticks of our own."""

LIBDWBC_OVER_OURS = {"libdwbc": ("whole_body", 35.0), "libdwbc_reduced": ("reduced", 18.0)}
"""Which controller each of libdwbc's ways is held against, and how many times longer it takes at
least: 10th percentiles of processor time, stack `table1`."""

Guest = Subject | PeerProcess
"""Who is timed a batch at a time: peers, and every `direct` beside them as their reference."""


def _read_stacks(text: str) -> tuple[str, ...]:
    return STACKS if text == "both" else (text,)


Stacks = Annotated[tuple[str, ...], read_by(_read_stacks, "S"), arg(name="stack")]


def _read_peers(text: str) -> dict[str, Path]:
    peers: dict[str, Path] = {}
    for word in words_of(text):
        name, separator, path = word.partition("=")
        if not separator or not path:
            raise ConfigurationError(
                "a peer needs the Python of its environment, or its program",
                got=word,
                wanted="NAME=PATH, such as tsid=peers/tsid/bin/python",
            )
        # The program of libdwbc serves both its ways.
        peers |= dict.fromkeys(PROGRAMS if name == "libdwbc" else (name,), Path(path))
    return peers


@dataclass(frozen=True, kw_only=True)
class TickBench(Bench):
    """Time a controller's tick from state to command, by phase, on a recorded moving run.

    example: python -m benchmarks tick --controller reduced
    """

    expected: ClassVar[tuple[str, ...]] = ()  # peers that are looked for in the environment

    robot: str = "humanoid33"  # name or path of a biped
    contacts: str = "double"  # "double" or "single" support
    controller: str = "whole_body"  # one of `CONTROLLERS`
    # "table1", "default", or both
    stacks: Stacks = STACKS
    # Names of the controller's methods, its usual ones when None; the whole-body controller's
    # `direct` is timed in any case, as the reference, and beside a method of the reduced controller
    # the whole-body controller's of the same name
    methods: MaybeWords = None
    # Python interpreters of other packages' environments, or programs, by name: of `TORQUE_PEERS`,
    # or of `VELOCITY_PEERS` beside a controller that commands velocities
    peers: Annotated[Mapping[str, Path], read_by(_read_peers, "P=PATH")] = field(
        default_factory=dict
    )
    ticks: int = 500  # timed ticks of each method

    def __post_init__(self) -> None:
        _check_choice("unknown contacts", [self.contacts], STANCES)
        _check_choice("unknown stack", self.stacks, STACKS)
        _check_choice("no such controller", [self.controller], tuple(CONTROLLERS))
        by_torques = CONTROLLERS[self.controller].actuation == "torque"
        beside = TORQUE_PEERS if by_torques else VELOCITY_PEERS
        _check_choice(f"unknown peer of {self.controller}", tuple(self.peers), beside)
        for name in self.methods or ():
            parse_method(self.controller, name)
        if self.ticks < 1:
            raise ConfigurationError("nothing to time", got=self.ticks, wanted="at least one tick")
        for name, path in self.peers.items():
            if not path.is_file():
                what, example = "Python interpreter", "peers/tsid/bin/python"
                if name in PROGRAMS:
                    what, example = "program", "peers/libdwbc_peer"
                raise ConfigurationError(
                    f"the {what} of peer {name!r} does not exist",
                    got=str(path),
                    wanted=f"a path such as {example}",
                )

    def act(self) -> int:
        """Time and print, with the peers that the environment names where none are given."""
        named = {name: os.environ.get(peer_variable(name)) for name in self.expected}
        found = {name: Path(path) for name, path in named.items() if path}
        plan = replace(self, peers=self.peers or found)
        plan.show(bench_tick, self.figures, format_table)
        missing = (how_to_install(name) for name in self.expected if name not in plan.peers)
        for words in dict.fromkeys(missing):
            print(words, file=sys.stderr)
        return 0

    def figures(self, results: Sequence[TickResult]) -> list[Figure]:
        """Figures with bounds; none here."""
        del results
        return []


@dataclass(frozen=True, kw_only=True)
class PeersBench(TickBench):
    """Time TSID, placo and libdwbc beside the full and the reduced controller.

    example: python -m benchmarks peers --peers tsid=peers/tsid/bin/python
    """

    expected: ClassVar[tuple[str, ...]] = TORQUE_PEERS
    controller: str = "reduced"
    stacks: Stacks = ("table1",)
    methods: MaybeWords = ("direct",)

    def figures(self, results: Sequence[TickResult]) -> list[Figure]:
        """Times of libdwbc over ours, with their bounds."""
        return peer_figures(results)


@dataclass(frozen=True, kw_only=True)
class VelocityBench(TickBench):
    """Time mink and pink beside every method of differential inverse kinematics.

    example: python -m benchmarks ik --peers mink=peers/mink/bin/python
    """

    expected: ClassVar[tuple[str, ...]] = VELOCITY_PEERS
    robot: str = "g1"
    controller: str = "differential_ik"
    methods: MaybeWords = CONTROLLERS["differential_ik"].strategies

    def figures(self, results: Sequence[TickResult]) -> list[Figure]:
        """Our times over mink's."""
        return velocity_figures(results)


def bench_tick(plan: TickBench, progress: Progress | None = None) -> list[TickResult]:
    """Records a moving run, then times every method on its states, tick by tick in turn.

    The order rotates from tick to tick, so that no method always runs after the same other one.
    Peers are other processes and take their turn a batch at a time; every `direct`, or every
    method of a controller that solves otherwise, is timed once more in the same way, as their
    reference. The garbage collector runs between batches, never
    inside a timed tick.
    """
    robot = load_robot(plan.robot)
    check_biped(robot)
    ticks = WARM_UP + plan.ticks
    methods = timed_methods(plan.controller, plan.methods)
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
            own = [Subject(recording, kind, m) for m in methods if _stands_beside_peers(m)]
            guests = [*own, *peers] if peers else []
            for done in _interleave(subjects, guests, ticks):
                if progress is not None:
                    progress(float(i * ticks + done), float(len(plan.stacks) * ticks))
            results += tick_results(recording, kind, "tick", subjects)
            if guests:
                results += tick_results(recording, kind, "batch", guests)
    return results


def _stands_beside_peers(method: Method) -> bool:
    """Whether peers are compared with it."""
    return method.name == DIRECT or method.controller not in BY_PROGRAMS


def velocity_figures(results: Sequence[TickResult]) -> list[Figure]:
    """Our inverse kinematics over mink's, by 10th percentiles of processor time."""
    figures: list[Figure] = []
    for kind in dict.fromkeys(r.stack for r in results):
        rows = [r for r in results if r.stack == kind and r.schedule == "batch"]
        times = [(r.controller, r.solver, r.cpu_p10_us) for r in rows if r.cpu_p10_us is not None]
        mink = [time for controller, _, time in times if controller == "mink"]
        for controller, solver, time in times:
            if mink and controller == "differential_ik":
                name = f"{controller} {solver} over mink, {rows[0].robot}, stack {kind!r}"
                ratio = round(time / mink[0], 3)
                figures.append(Figure.at_most(name, ratio, 1.0))
    return figures


def _interleave(subjects: Sequence[Subject], guests: Sequence[Guest], ticks: int) -> Generator[int]:
    """Times everything; yields the number of ticks done, a batch at a time."""
    for batch in batches(ticks, BATCH):
        for tick in batch:
            for one in in_turn(subjects, tick):
                one.tick(tick)
        for one in in_turn(guests, batch.start // BATCH):
            one.run(batch.start, len(batch))
        yield batch.stop


def tick_results(
    recording: Recording,
    kind: str,
    schedule: str,
    timed: Sequence[Guest],
    counted: Mapping[str, Ticks] | None = None,
) -> list[TickResult]:
    """Results of those that were timed on one schedule, the first of which is the reference."""
    robot, first = recording.robot, timed[0]
    ways = {one.solver: one for one in timed if one.name == "whole_body"}
    results: list[TickResult] = []
    for one in timed:
        ticks = _COUNTED if counted is None else counted[one.solver]
        residual, relaxed, missed = one.accuracy(ticks)
        variables, rows = one.size()
        whole = ways.get(one.solver)
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
                **time_statistics(
                    one.times(ticks),
                    first.times(ticks),
                    None if whole is None else whole.times(ticks),
                ),
            )
        )
    return results


def peer_figures(results: Sequence[TickResult]) -> list[Figure]:
    """What must hold of libdwbc's ticks, where they were timed."""
    rows = {r.controller: r for r in results if (r.schedule, r.stack) == ("batch", "table1")}
    figures: list[Figure] = []
    for peer, (controller, bound) in LIBDWBC_OVER_OURS.items():
        times = [rows[name].cpu_p10_us for name in (peer, controller) if name in rows]
        if len(times) < 2 or times[0] is None or not times[1]:
            continue
        ours, where = round(times[0] / times[1], 1), rows[peer]
        name = f"{where.robot}, {where.contacts} support: {peer} over {controller}"
        figures.append(Figure.at_least(name, ours, bound))
    return figures


def _check_choice(what: str, names: Sequence[str], choices: Sequence[str]) -> None:
    for name in names:
        if name not in choices:
            raise UnknownNameError(what, got=name, choices=choices)
