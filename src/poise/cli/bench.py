"""`poise bench`: timings, interleaved in one run."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from poise.cli.options import add_output_options, make_folder
from poise.cli.progress import Bar
from poise.errors import ConfigurationError, UnknownNameError

_NAMES = ("tick", "bias")
"""Benchmarks by name."""

_TICK_ONLY = ("contacts", "controller", "stack", "methods", "peers")
"""Options that mean nothing to the other benchmark."""

_TELEOP = "teleop"
"""A controller that is no resolver of tasks: it walks, and is timed on a walk."""

_TASKS_ONLY = ("contacts", "stack", "methods", "peers")
"""Options that mean nothing to it."""


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "bench",
        help="timings, interleaved in one run",
        description="tick: times a controller's tick from state to command, by phase, on a "
        "recorded moving run. tick --controller teleop: times the step teleoperator on a recorded "
        "walk over an obstacle, and the whole simulation of that walk against real time. bias: "
        "times the formulas of the bias acceleration on a recorded run of a robot on a fixed base. "
        "Whatever is compared is timed tick by tick in turn on the same states.",
        epilog="example: poise bench tick --robot talos --peers tsid=peers/tsid/bin/python; "
        "poise bench tick --controller teleop; poise bench bias --json",
    )
    parser.add_argument("name", metavar="NAME", help="what to time: " + ", ".join(_NAMES))
    parser.add_argument(
        "--robot",
        metavar="R",
        help="tick: a biped (default: humanoid33; with --controller teleop: biped20); bias: a "
        "robot on a fixed base with hands (default: upper17)",
    )
    parser.add_argument("--contacts", metavar="C", help="tick: double (default) or single")
    parser.add_argument(
        "--controller",
        metavar="C",
        help="tick: whole_body (default), osf, differential_ik, or teleop, which takes only "
        "--robot, --ticks, --out and --json beside it",
    )
    parser.add_argument("--stack", metavar="S", help="tick: table1, default or both (default)")
    parser.add_argument(
        "--methods",
        metavar="M,M",
        help="tick: such as cascade/osqp,cascade/proxqp,weighted; direct is always timed",
    )
    parser.add_argument(
        "--peers",
        metavar="P=PYTHON",
        help="tick: other packages and the Python of their environment: tsid=PATH,placo=PATH",
    )
    parser.add_argument(
        "--ticks",
        metavar="N",
        type=int,
        help="timed ticks (default: 500 for tick, one walk with --controller teleop, 1100 for "
        "bias)",
    )
    add_output_options(parser, "none is written")
    parser.set_defaults(act=act)


def act(options: argparse.Namespace) -> int:
    """Runs a benchmark."""
    if options.name not in _NAMES:
        raise UnknownNameError("unknown benchmark", got=options.name, choices=_NAMES)
    if options.name == "bias":
        _bias(options)
    elif options.controller == _TELEOP:
        _teleop(options)
    else:
        _tick(options)
    return 0


def _tick(options: argparse.Namespace) -> None:
    from poise.bench import STACKS, TickBench, bench_tick, format_table
    from poise.control import CONTROLLERS

    if options.controller is not None and options.controller not in CONTROLLERS:
        raise UnknownNameError(
            "no such controller", got=options.controller, choices=(*CONTROLLERS, _TELEOP)
        )
    stack = options.stack or "both"
    plan = TickBench(
        **_given(options, ("robot", "contacts", "controller", "ticks")),
        stacks=STACKS if stack == "both" else (stack,),
        methods=_words(options.methods) if options.methods else None,
        peers=_peers(options.peers or ""),
    )
    folder = make_folder(options.out, ".") if options.out else None
    with Bar("timing", " ticks") as bar:
        results = bench_tick(plan, bar)
    lines = _report(options, results, format_table)
    if folder is not None:
        from poise.bench import write_figure

        (folder / "bench.json").write_text(lines, encoding="utf-8")
        write_figure(results, folder / "bench.png")


def _bias(options: argparse.Namespace) -> None:
    _refuse(options, _TICK_ONLY, "belongs to the benchmark tick", "bias")
    from poise.bench import BiasBench, bench_bias, format_bias_table

    plan = BiasBench(**_given(options, ("robot", "ticks")))
    _run(options, plan, bench_bias, format_bias_table)


def _teleop(options: argparse.Namespace) -> None:
    _refuse(options, _TASKS_ONLY, "belongs to controllers of tasks", "--controller teleop")
    from poise.bench import TeleopBench, bench_teleop, format_teleop_table

    plan = TeleopBench(**_given(options, ("robot", "ticks")))
    _run(options, plan, bench_teleop, format_teleop_table)


def _refuse(options: argparse.Namespace, names: Sequence[str], why: str, benchmark: str) -> None:
    """Refuses options that mean nothing to a benchmark.

    Raises:
        ConfigurationError: one of them was given.
    """
    for name in names:
        if getattr(options, name) is not None:
            raise ConfigurationError(
                f"--{name} {why}",
                got=f"--{name} {getattr(options, name)}",
                wanted=f"only --robot, --ticks, --out and --json with {benchmark}",
            )


def _run(options: argparse.Namespace, plan: Any, bench: Any, table: Any) -> None:
    """Times, prints, and writes `bench.json` where a folder is wanted."""
    folder = make_folder(options.out, ".") if options.out else None
    with Bar("timing", " ticks") as bar:
        results = bench(plan, bar)
    lines = _report(options, results, table)
    if folder is not None:
        (folder / "bench.json").write_text(lines, encoding="utf-8")


def _report(options: argparse.Namespace, results: Sequence[Any], table: Any) -> str:
    """Prints results; returns them as JSON, one a line."""
    lines = "".join(json.dumps(result.to_json()) + "\n" for result in results)
    print(lines if options.json else table(results), end="" if options.json else "\n")
    return lines


def _given(options: argparse.Namespace, names: Sequence[str]) -> dict[str, Any]:
    """Options that were given; for the others the benchmark's own defaults hold."""
    return {name: getattr(options, name) for name in names if getattr(options, name) is not None}


def _words(text: str) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(",") if word.strip())


def _peers(text: str) -> dict[str, Path]:
    """Reads `name=path,name=path`.

    Raises:
        ConfigurationError: a part without a path.
    """
    peers: dict[str, Path] = {}
    for word in _words(text):
        name, separator, path = word.partition("=")
        if not separator or not path:
            raise ConfigurationError(
                "a peer needs the Python of its environment",
                got=word,
                wanted="NAME=PATH, such as tsid=peers/tsid/bin/python",
            )
        peers[name] = Path(path)
    return peers
