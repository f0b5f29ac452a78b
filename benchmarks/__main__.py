"""`python -m benchmarks`: timings, interleaved in one run."""

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.hqp.command import act_hqp, add_hqp_options
from benchmarks.options import folder_of, words_of
from poise.cli import Bar, run_command
from poise.errors import ConfigurationError, UnknownNameError

_TELEOP = "teleop"
"""A controller that is no resolver of tasks: it walks, and is timed on a walk."""

_OWN = {
    "tick": ("robot", "contacts", "controller", "stack", "methods", "peers", "ticks"),
    "dof": ("joints", "contacts", "stack", "ticks"),
    "peers": ("robot", "contacts", "stack", "peers", "ticks"),
    "bias": ("robot", "ticks"),
    "hqp": ("problems", "sequences", "methods", "count", "save"),
}
"""Benchmarks by name, and the options that mean something to each."""

_OWN_TELEOP = ("robot", "ticks", "controller")
"""Options that mean something to the step teleoperator's timing."""

_OPTIONS = tuple(dict.fromkeys(option for own in _OWN.values() for option in own))


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one benchmark.

    Args:
        arguments: the command line without the program's name; the process's own when None.

    Returns:
        The exit status: 0 done, 2 bad input.
    """
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="tick: times a controller's tick from state to command, by phase, on a "
        "recorded moving run. tick --controller teleop: times the step teleoperator on a recorded "
        "walk over an obstacle, and the whole simulation of that walk against real time. dof: "
        "times the full and the reduced controller on robots of 20 to 60 joints. peers: times "
        "TSID and placo beside both. bias: times the formulas of the bias acceleration on a "
        "recorded run of a robot on a fixed base. hqp: races solvers on hierarchical problems of "
        "robots, of inverse kinematics and of chance, and judges their answers. Whatever is "
        "compared is timed in turn on the same states.",
        epilog="example: python -m benchmarks tick --controller reduced; "
        "python -m benchmarks tick --controller teleop; python -m benchmarks dof --joints 33,60; "
        "python -m benchmarks peers --peers tsid=peers/tsid/bin/python; "
        "python -m benchmarks bias --json; "
        "python -m benchmarks hqp --methods daqp-hierarchical,cascade/osqp --out bench",
    )
    parser.add_argument("name", metavar="NAME", help="what to time: " + ", ".join(_OWN))
    parser.add_argument(
        "--robot",
        metavar="R",
        help="tick, peers: a biped (default: humanoid33; with --controller teleop: biped20); bias: "
        "a robot on a fixed base with hands (default: upper17)",
    )
    parser.add_argument(
        "--joints",
        metavar="N,N",
        help="dof: joints of the robots, 20 to 60 (default: ten of them)",
    )
    parser.add_argument(
        "--contacts",
        metavar="C",
        help="tick, peers: double (default) or single; dof: double, single or double,single "
        "(default)",
    )
    parser.add_argument(
        "--controller",
        metavar="C",
        help="tick: whole_body (default), reduced, osf, differential_ik, or teleop, which takes "
        "only --robot, --ticks, --out and --json beside it",
    )
    parser.add_argument(
        "--stack", metavar="S", help="table1, default or both (tick: both; dof, peers: table1)"
    )
    parser.add_argument(
        "--methods",
        metavar="M,M",
        help="tick: such as cascade/osqp,cascade/proxqp,weighted; direct is always timed; hqp: "
        "likewise, or daqp-hard, daqp-hierarchical, direct/solve (default: all that are "
        "installed); direct is always timed",
    )
    parser.add_argument(
        "--peers",
        metavar="P=PYTHON",
        help="tick, peers: other packages and the Python of their environment: "
        "tsid=PATH,placo=PATH",
    )
    parser.add_argument(
        "--ticks",
        metavar="N",
        type=int,
        help="timed ticks (default: 500 for tick and peers, 300 for dof, one walk with "
        "--controller teleop, 1100 for bias)",
    )
    add_hqp_options(parser)
    parser.add_argument("--out", metavar="DIR", help="folder to write into (default: none)")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.set_defaults(act=_act)
    return run_command(parser, arguments)


def _act(options: argparse.Namespace) -> int:
    """Runs a benchmark."""
    if options.name not in _OWN:
        raise UnknownNameError("unknown benchmark", got=options.name, choices=_OWN)
    teleop = options.name == "tick" and options.controller == _TELEOP
    _refuse_foreign(options, teleop)
    runs: dict[str, Callable[[argparse.Namespace], None]] = {
        "tick": _teleop if teleop else _tick,
        "dof": _dof,
        "peers": _peers,
        "bias": _bias,
        "hqp": act_hqp,
    }
    runs[options.name](options)
    return 0


def _refuse_foreign(options: argparse.Namespace, teleop: bool) -> None:
    """Refuses options that mean nothing to a benchmark.

    Raises:
        ConfigurationError: one of them was given.
    """
    own = _OWN_TELEOP if teleop else _OWN[options.name]
    for name in _OPTIONS:
        if name in own or getattr(options, name) is None:
            continue
        others = [other for other, names in _OWN.items() if name in names]
        why = "controllers of tasks" if teleop else f"the benchmark {' or '.join(others)}"
        what = "--controller teleop" if teleop else options.name
        raise ConfigurationError(
            f"--{name} belongs to {why}",
            got=f"--{name} {getattr(options, name)}",
            wanted=", ".join(f"--{n}" for n in (*own, "out", "json")) + f" with {what}",
        )


def _tick(options: argparse.Namespace) -> None:
    from benchmarks.tick import TickBench, bench_tick
    from poise.control import CONTROLLERS

    if options.controller is not None and options.controller not in CONTROLLERS:
        raise UnknownNameError(
            "no such controller", got=options.controller, choices=(*CONTROLLERS, _TELEOP)
        )
    plan = TickBench(
        **_given(options, ("robot", "contacts", "controller", "ticks")),
        stacks=_stacks(options.stack or "both"),
        methods=words_of(options.methods) if options.methods else None,
        peers=_interpreters(options.peers or ""),
    )
    _run_ticks(options, plan, bench_tick)


def _peers(options: argparse.Namespace) -> None:
    from benchmarks.peers.process import PEERS
    from benchmarks.peers_bench import how_to_install, peers_bench
    from benchmarks.tick import bench_tick

    peers = _interpreters(options.peers) if options.peers else _interpreters_of_environment(PEERS)
    plan = peers_bench(
        peers,
        **_given(options, ("robot", "contacts", "ticks")),
        stacks=_stacks(options.stack or "table1"),
    )
    _run_ticks(options, plan, bench_tick)
    for name in PEERS:
        if name not in peers:
            print(how_to_install(name), file=sys.stderr)


def _run_ticks(options: argparse.Namespace, plan: Any, bench: Any) -> None:
    """Times, prints, and writes `bench.json` and a figure where a folder is wanted."""
    from benchmarks.figure import write_figure
    from benchmarks.result import format_table

    results, folder = _run(options, plan, bench, format_table)
    if folder is not None:
        write_figure(results, folder / "bench.png")


def _dof(options: argparse.Namespace) -> None:
    from benchmarks.dof import DofBench, bench_dof, format_dof_table
    from benchmarks.targets import speed_targets

    given = _given(options, ("ticks", "stack"))
    if options.joints is not None:
        given["joints"] = _numbers(options.joints)
    if options.contacts is not None:
        given["contacts"] = words_of(options.contacts)
    plan = DofBench(**given)
    _run(options, plan, bench_dof, format_dof_table, speed_targets)


def _bias(options: argparse.Namespace) -> None:
    from benchmarks.bias import BiasBench, bench_bias, format_bias_table

    plan = BiasBench(**_given(options, ("robot", "ticks")))
    _run(options, plan, bench_bias, format_bias_table)


def _teleop(options: argparse.Namespace) -> None:
    from benchmarks.teleop import TeleopBench, bench_teleop
    from benchmarks.teleop_table import format_teleop_table

    plan = TeleopBench(**_given(options, ("robot", "ticks")))
    _run(options, plan, bench_teleop, format_teleop_table)


def _run(
    options: argparse.Namespace, plan: Any, bench: Any, table: Any, more: Any = None
) -> tuple[Any, Path | None]:
    """Times, prints, and writes `bench.json` where a folder is wanted.

    Args:
        options: of the command line.
        plan: what to time.
        bench: times it.
        table: makes a table of the results.
        more: makes further lines of JSON of them.

    Returns:
        The results, and the folder.
    """
    folder = folder_of(options.out)
    with Bar("timing", " ticks") as bar:
        results = bench(plan, bar)
    objects = [*results, *(more(results) if more is not None else ())]
    lines = "".join(json.dumps(one.to_json()) + "\n" for one in objects)
    print(lines if options.json else table(results), end="" if options.json else "\n")
    if folder is not None:
        (folder / "bench.json").write_text(lines, encoding="utf-8")
    return results, folder


def _given(options: argparse.Namespace, names: Sequence[str]) -> dict[str, Any]:
    """Options that were given; for the others the benchmark's own defaults hold."""
    return {name: getattr(options, name) for name in names if getattr(options, name) is not None}


def _numbers(text: str) -> tuple[int, ...]:
    """Reads `20,33,60`.

    Raises:
        ConfigurationError: a part that is no whole number.
    """
    words = words_of(text)
    for word in words:
        if not (word.isascii() and word.isdigit()):
            raise ConfigurationError(
                "a number of joints is not a number", got=word, wanted="such as 20,33,60"
            )
    return tuple(int(word) for word in words)


def _stacks(name: str) -> tuple[str, ...]:
    from benchmarks.stances import STACKS

    return STACKS if name == "both" else (name,)


def _interpreters_of_environment(names: Sequence[str]) -> dict[str, Path]:
    """Peers whose Python the environment names: POISE_TSID_PYTHON, POISE_PLACO_PYTHON."""
    found = {name: os.environ.get(f"POISE_{name.upper()}_PYTHON") for name in names}
    return {name: Path(path) for name, path in found.items() if path}


def _interpreters(text: str) -> dict[str, Path]:
    """Reads `name=path,name=path`.

    Raises:
        ConfigurationError: a part without a path.
    """
    peers: dict[str, Path] = {}
    for word in words_of(text):
        name, separator, path = word.partition("=")
        if not separator or not path:
            raise ConfigurationError(
                "a peer needs the Python of its environment",
                got=word,
                wanted="NAME=PATH, such as tsid=peers/tsid/bin/python",
            )
        peers[name] = Path(path)
    return peers


if __name__ == "__main__":
    sys.exit(main())
