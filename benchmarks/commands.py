"""Commands of `python -m benchmarks`: `COMMANDS`, and the options that they share."""

import argparse
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from poise.cli import Bar
from poise.errors import ConfigurationError, UnknownNameError


@dataclass(frozen=True, kw_only=True)
class Command:
    """A benchmark as a command."""

    name: str  # of the command
    target: str  # module, then the names of plan, benchmark and figures in it
    does: str  # its purpose, in a sentence without a subject
    example: str  # its options in an example
    # Help of each option; each is a field of the plan
    options: Mapping[str, str] = field(default_factory=dict[str, str])
    unit: str = " ticks"  # of the progress

    def add(self, commands: Any) -> None:
        """Add the command to the command line."""
        parser = add_command(commands, self.name, self._act, self.does, self.example)
        for option, words in self.options.items():
            kind = {"ticks": int, "messages": int, "presses": int, "rate": float}.get(option, str)
            parser.add_argument(f"--{option}", metavar=option[0].upper(), type=kind, help=words)

    def _act(self, options: argparse.Namespace) -> None:
        from benchmarks.result import result_table

        module, *names = self.target.split()
        plan, bench, figures = (getattr(import_module(f"benchmarks.{module}"), n) for n in names)
        made = plan(**given(options, *self.options))
        time_and_print(options, made, bench, result_table, figures, self.unit)


@dataclass(frozen=True, kw_only=True)
class TickCommand:
    """A command that times ticks by `benchmarks.tick`, beside peers in other processes."""

    name: str  # of the command
    does: str  # its purpose, in a sentence without a subject
    example: str  # its options in an example
    robot: str = "humanoid33"  # default
    stacks: str = "both"  # default of `--stack`
    controller: str | None = None  # that is timed; an option where None
    # Name of the tuple of peers in `benchmarks.peers.process` that are expected; none are where ""
    peers: str = ""
    figures: str = ""  # name of a function of `benchmarks.tick`

    def add(self, commands: Any) -> None:
        """Add the command to the command line."""
        parser = add_command(commands, self.name, self._act, self.does, self.example)
        parser.add_argument("--robot", metavar="R", help=f"a biped (default: {self.robot})")
        parser.add_argument("--contacts", metavar="C", help="double (default) or single")
        parser.add_argument("--ticks", metavar="N", type=int, help="timed ticks (default: 500)")
        parser.add_argument(
            "--stack", metavar="S", help=f"table1, default or both (default: {self.stacks})"
        )
        parser.add_argument(
            "--peers",
            metavar="P=PATH",
            help="other packages and the Python of their environment, or their program: "
            "tsid=PATH,placo=PATH,libdwbc=PATH, or of inverse kinematics mink, pink",
        )
        if self.controller is None:
            parser.add_argument(
                "--controller",
                metavar="C",
                help="whole_body (default), reduced, osf or differential_ik",
            )
            parser.add_argument(
                "--methods",
                metavar="M,M",
                help="such as cascade/osqp,cascade/proxqp,weighted; direct is always timed",
            )

    def _act(self, options: argparse.Namespace) -> None:
        from benchmarks import tick
        from benchmarks.peers import process
        from benchmarks.recording import STACKS
        from benchmarks.result import format_table
        from poise.control import CONTROLLERS

        controller = self.controller or options.controller or "whole_body"
        if controller not in CONTROLLERS:
            raise UnknownNameError("no such controller", got=controller, choices=tuple(CONTROLLERS))
        methods: tuple[str, ...] | None = None
        if self.controller is None:
            methods = words_of(options.methods) if options.methods else None
        elif self.controller == "reduced":
            methods = ("direct",)
        else:
            methods = CONTROLLERS[self.controller].strategies
        expected: Sequence[str] = getattr(process, self.peers) if self.peers else ()
        stack = options.stack or self.stacks
        plan = tick.TickBench(
            **given(options, "contacts", "ticks"),
            robot=options.robot or self.robot,
            controller=controller,
            stacks=STACKS if stack == "both" else (stack,),
            methods=methods,
            peers=_peers_at_hand(options, expected),
        )
        figures = getattr(tick, self.figures) if self.figures else None
        time_and_print(options, plan, tick.bench_tick, format_table, figures)
        missing = (process.how_to_install(name) for name in expected if name not in plan.peers)
        for words in dict.fromkeys(missing):
            print(words, file=sys.stderr)


COMMANDS: tuple[Command | TickCommand, ...] = (
    TickCommand(
        name="tick",
        does="times a controller's tick from state to command, by phase, on a recorded moving run",
        example="--controller reduced",
    ),
    TickCommand(
        name="peers",
        does="times TSID, placo and libdwbc beside the full and the reduced controller",
        example="--peers tsid=peers/tsid/bin/python",
        stacks="table1",
        controller="reduced",
        peers="TORQUE_PEERS",
        figures="peer_figures",
    ),
    Command(
        name="batch",
        target="batch BatchBench bench_batch batch_figures",
        does="times many states in one call beside single ticks, on one thread and on two",
        example="--robot g1",
        options={
            "robot": "a biped (default: g1)",
            "stack": "table1 or default (default)",
            "ticks": "states of one (default: 4096)",
        },
    ),
    TickCommand(
        name="ik",
        does="times mink and pink beside every method of differential inverse kinematics",
        example="--peers mink=peers/mink/bin/python",
        robot="g1",
        controller="differential_ik",
        peers="VELOCITY_PEERS",
        figures="velocity_figures",
    ),
    Command(
        name="first",
        target="first FirstBench bench_first first_figures",
        does="times import and first controller, from an empty cache and in a second process",
        example="--controller osf",
        options={
            "robot": "any (default: humanoid33)",
            "controller": "whole_body (default), reduced, osf or differential_ik",
        },
        unit=" processes",
    ),
    Command(
        name="latency",
        target="latency LatencyBench bench_latency latency_figures",
        does="times an operator's message over the websocket, stage by stage, until the robot has "
        "its command",
        example="--actuation torque",
        options={
            "robot": "a biped (default: biped20)",
            "actuation": "velocity (default) or torque",
            "messages": "messages that count (default: 1000)",
            "rate": "of the messages [Hz] (default: 60)",
        },
        unit=" messages",
    ),
    Command(
        name="keys",
        target="keys KeysBench bench_keys keys_figures",
        does="presses a key in a browser without a screen, and times how soon the commanded "
        "velocity of the robot changes",
        example="--presses 20",
        options={
            "robot": "a humanoid (default: g1)",
            "presses": "presses that count (default: 40)",
        },
        unit=" presses",
    ),
    Command(
        name="run",
        target="running RunBench bench_run run_figures",
        does="times whole scenarios, recorded and logged, by parts of a tick, and the worst tick",
        example="--scenarios walk,over_an_obstacle --robot g1 --ticks 50000",
        options={
            "scenarios": "shipped scenarios or YAML files (default: walk)",
            "robot": "another than the scenarios'",
            "ticks": "ticks of each scenario, in as many runs as it takes (default: one run)",
        },
        unit="",
    ),
)
"""Commands but `hqp`, in the order of the documentation's page."""


def add_command(
    commands: Any, name: str, act: Callable[[argparse.Namespace], None], does: str, example: str
) -> argparse.ArgumentParser:
    """Add a benchmark to the command line, with the options that all have; return its parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=does,
        description=f"{does[0].upper()}{does[1:]}. What is compared is timed in turn.",
        epilog=f"example: python -m benchmarks {name} {example}".rstrip(),
    )
    parser.add_argument("--out", metavar="DIR", help="folder to write into (default: none)")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")

    def done(options: argparse.Namespace) -> int:
        act(options)
        return 0

    parser.set_defaults(act=done)
    return parser


def time_and_print(
    options: argparse.Namespace,
    plan: Any,
    bench: Callable[..., Any],
    table: Callable[..., str],
    more: Callable[..., Any] | None = None,
    unit: str = " ticks",
) -> Any:
    """Time, print, and write `bench.json` where a folder is wanted; return the results."""
    folder = folder_of(options.out)
    with Bar("timing", unit) as bar:
        results = bench(plan, bar)
    figures = more(results) if more is not None else ()
    lines = "".join(json.dumps(one.to_json()) + "\n" for one in (*results, *figures))
    words = "\n".join([table(results), *(figure.words() for figure in figures)])
    print(lines if options.json else words, end="" if options.json else "\n")
    if folder is not None:
        (folder / "bench.json").write_text(lines, encoding="utf-8")
    return results


def given(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Options that were given, words with commas between them apart for `scenarios`."""
    found = {name: getattr(options, name) for name in names}
    return {
        name: words_of(value) if name == "scenarios" else value
        for name, value in found.items()
        if value is not None
    }


def words_of(text: str) -> tuple[str, ...]:
    """Read `a,b,c`: words with commas between them."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def folder_of(wanted: str | None) -> Path | None:
    """Make the folder to write into if it is not there; None for none."""
    if wanted is None:
        return None
    folder = Path(wanted)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _peers_at_hand(options: argparse.Namespace, names: Sequence[str]) -> dict[str, Path]:
    """Peers of the command line, or else those that POISE_TSID_PYTHON and others name."""
    from benchmarks.peers.process import PROGRAMS, peer_variable

    if not options.peers:
        named = {name: os.environ.get(peer_variable(name)) for name in names}
        return {name: Path(path) for name, path in named.items() if path}
    peers: dict[str, Path] = {}
    for word in words_of(options.peers):
        name, separator, path = word.partition("=")
        if not separator or not path:
            raise ConfigurationError(
                "a peer needs the Python of its environment, or its program",
                got=word,
                wanted="NAME=PATH, such as tsid=peers/tsid/bin/python",
            )
        # The program of libdwbc serves both its ways.
        for one in PROGRAMS if name == "libdwbc" else (name,):
            peers[one] = Path(path)
    return peers
