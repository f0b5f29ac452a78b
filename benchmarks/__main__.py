"""`python -m benchmarks`: timings, interleaved in one run."""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.hqp.command import MADE, act_hqp
from benchmarks.options import folder_of, words_of
from poise.cli import Bar, run_command
from poise.errors import ConfigurationError, UnknownNameError

BENCHMARKS = (
    "tick", "growth", "dof", "peers", "ik", "batch", "bias", "hqp", "run", "worst", "first",
)  # fmt: skip
"""What can be timed. `tick --controller teleop` stands apart, because the step teleoperator is no
resolver of tasks: it walks, and is timed on a walk. It is called `teleop` here."""

_OPTIONS: dict[str, tuple[str, tuple[str, ...], str]] = {
    "robot": (
        "R",
        ("tick", "teleop", "peers", "ik", "batch", "bias", "run", "worst", "first"),
        "tick, peers, ik, batch: a biped (default: humanoid33; ik, batch: g1; with --controller "
        "teleop: biped20); bias: a robot on a fixed base with hands (default: upper17); run, "
        "worst: another than the scenario's; first: any (default: humanoid33)",
    ),
    "scenario": ("S", ("run",), "run: a shipped scenario or a YAML file (default: walk)"),
    "scenarios": (
        "S,S",
        ("worst",),
        "worst: shipped scenarios or YAML files (default: seven of torque controllers)",
    ),
    "joints": ("N,N", ("dof",), "dof: joints of the robots, 20 to 60 (default: ten of them)"),
    "contacts": (
        "C",
        ("tick", "dof", "peers", "ik"),
        "tick, peers, ik: double (default) or single; dof: double, single or double,single "
        "(default)",
    ),
    "controller": (
        "C",
        ("tick", "teleop", "first"),
        "tick, first: whole_body (default), reduced, osf, differential_ik; tick: or teleop, which "
        "takes only --robot, --ticks, --out and --json beside it",
    ),
    "stack": (
        "S",
        ("tick", "dof", "peers", "ik", "batch"),
        "table1, default or, but for dof and batch, both (tick, ik: both; dof, peers: table1; "
        "batch: default)",
    ),
    "methods": (
        "M,M",
        ("tick", "hqp"),
        "tick: such as cascade/osqp,cascade/proxqp,weighted; direct is always timed; hqp: "
        "likewise, or daqp-hard, daqp-hierarchical, direct/solve (default: all that are "
        "installed); direct is always timed",
    ),
    "peers": (
        "P=PATH",
        ("tick", "peers", "ik"),
        "tick, peers: other packages and the Python of their environment, or their program: "
        "tsid=PATH,placo=PATH,libdwbc=PATH; ik, tick --controller differential_ik: "
        "mink=PATH,pink=PATH",
    ),
    "ticks": (
        "N",
        ("tick", "teleop", "growth", "dof", "peers", "ik", "batch", "bias", "worst"),
        "timed ticks (default: 500 for tick, peers and ik, 400 for growth, 300 for dof, one walk "
        "with --controller teleop, 1100 for bias); batch: states of one (default: 4096); worst: of "
        "each scenario (default: 100000)",
    ),
    "problems": (
        "FOLDER",
        ("hqp",),
        "hqp: race on the sequences saved there, not on new ones",
    ),
    "sequences": (
        "S,S",
        ("hqp",),
        "hqp: names of sequences (default: all of FOLDER, or a selection that is quickly made; "
        "all: every one that can be made)",
    ),
    "count": (
        "N",
        ("hqp",),
        f"hqp: most problems of a sequence (default: {MADE}, or all of those in FOLDER)",
    ),
    "save": ("FOLDER", ("hqp",), "hqp: make all sequences and save them, race nothing"),
}
"""Options by name: what their value is called, the benchmarks that take them, and the help."""


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
        "walk over an obstacle, and the whole simulation of that walk against real time. growth: "
        "how a tick grows with joints, levels, tasks and contacts. dof: times the full and the "
        "reduced controller on robots of 20 to 60 joints. peers: times TSID, placo and libdwbc "
        "beside both. "
        "ik: times mink and pink beside inverse kinematics. batch: times many states in one call "
        "beside single ticks, on one thread and on two. bias: times the formulas of the bias "
        "acceleration on a recorded run of a robot on a fixed base. hqp: races solvers on "
        "hierarchical problems of robots, of inverse kinematics and of chance, and judges their "
        "answers. run: the processor time of a whole scenario, recorded and logged, and where it "
        "goes. worst: the worst tick of many runs of scenarios. first: import and first "
        "controller, from an empty cache and in a second process. Whatever is compared is timed "
        "in turn on the same states.",
        epilog="example: python -m benchmarks tick --controller reduced; "
        "python -m benchmarks tick --controller teleop; python -m benchmarks dof --joints 33,60; "
        "python -m benchmarks peers --peers tsid=peers/tsid/bin/python; "
        "python -m benchmarks ik --peers mink=peers/mink/bin/python; "
        "python -m benchmarks bias --json; "
        "python -m benchmarks hqp --methods daqp-hierarchical,cascade/osqp --out bench; "
        "python -m benchmarks run --scenario walk --robot g1; "
        "python -m benchmarks worst --scenarios push,walk; python -m benchmarks first",
    )
    parser.add_argument("name", metavar="NAME", help="what to time: " + ", ".join(BENCHMARKS))
    for name, (metavar, _, words) in _OPTIONS.items():
        kind = int if metavar == "N" else str
        parser.add_argument(f"--{name}", metavar=metavar, type=kind, help=words)
    parser.add_argument("--out", metavar="DIR", help="folder to write into (default: none)")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.set_defaults(act=_act)
    return run_command(parser, arguments)


def _act(options: argparse.Namespace) -> int:
    if options.name not in BENCHMARKS:
        raise UnknownNameError("unknown benchmark", got=options.name, choices=BENCHMARKS)
    teleop = options.name == "tick" and options.controller == "teleop"
    name = "teleop" if teleop else options.name
    _refuse_foreign(options, name)
    runs = {
        "tick": _tick,
        "teleop": _teleop,
        "growth": _growth,
        "dof": _dof,
        "peers": _peers,
        "ik": _ik,
        "batch": _batch,
        "bias": _bias,
        "run": _whole,
        "worst": _worst,
        "first": _first,
    }
    (runs | {"hqp": act_hqp})[name](options)
    return 0


def _refuse_foreign(options: argparse.Namespace, benchmark: str) -> None:
    """Refuses options that mean nothing to a benchmark.

    Raises:
        ConfigurationError: one of them was given.
    """
    teleop = benchmark == "teleop"
    own = [name for name, (_, owners, _) in _OPTIONS.items() if benchmark in owners]
    for name, (_, owners, _) in _OPTIONS.items():
        if name in own or getattr(options, name) is None:
            continue
        others = " or ".join(owner for owner in owners if owner != "teleop")
        what = "--controller teleop" if teleop else benchmark
        raise ConfigurationError(
            f"--{name} belongs to "
            + ("controllers of tasks" if teleop else f"the benchmark {others}"),
            got=f"--{name} {getattr(options, name)}",
            wanted=", ".join(f"--{n}" for n in (*own, "out", "json")) + f" with {what}",
        )


def _tick(options: argparse.Namespace) -> None:
    from benchmarks.tick import TickBench
    from poise.control import CONTROLLERS

    if options.controller is not None and options.controller not in CONTROLLERS:
        raise UnknownNameError(
            "no such controller", got=options.controller, choices=(*CONTROLLERS, "teleop")
        )
    plan = TickBench(
        **_given(options, "robot", "contacts", "controller", "ticks"),
        stacks=_stacks(options.stack or "both"),
        methods=words_of(options.methods) if options.methods else None,
        peers=_interpreters(options.peers or ""),
    )
    _run_ticks(options, plan)


def _peers(options: argparse.Namespace) -> None:
    """Other packages beside the full and the reduced controller, by their default solver."""
    from benchmarks.peers.process import TORQUE_PEERS
    from benchmarks.tick import TickBench, peer_figures

    plan = TickBench(
        **_given(options, "robot", "contacts", "ticks"),
        controller="reduced",
        stacks=_stacks(options.stack or "table1"),
        methods=("direct",),
        peers=_peers_at_hand(options, TORQUE_PEERS),
    )
    _run_ticks(options, plan, peer_figures)
    _say_who_is_missing(plan, TORQUE_PEERS)


def _ik(options: argparse.Namespace) -> None:
    """Other packages beside every method of differential inverse kinematics."""
    from benchmarks.peers.process import VELOCITY_PEERS
    from benchmarks.tick import TickBench, velocity_figures
    from poise.control import CONTROLLERS

    plan = TickBench(
        **_given(options, "contacts", "ticks"),
        robot=options.robot or "g1",
        controller="differential_ik",
        stacks=_stacks(options.stack or "both"),
        methods=CONTROLLERS["differential_ik"].strategies,
        peers=_peers_at_hand(options, VELOCITY_PEERS),
    )
    _run_ticks(options, plan, velocity_figures)
    _say_who_is_missing(plan, VELOCITY_PEERS)


def _peers_at_hand(options: argparse.Namespace, names: Sequence[str]) -> dict[str, Path]:
    """Peers of the command line, or else those that POISE_TSID_PYTHON and others name."""
    from benchmarks.peers.process import peer_variable

    if options.peers:
        return _interpreters(options.peers)
    named = {name: os.environ.get(peer_variable(name)) for name in names}
    return {name: Path(path) for name, path in named.items() if path}


def _say_who_is_missing(plan: Any, names: Sequence[str]) -> None:
    from benchmarks.peers.process import how_to_install

    missing = (how_to_install(name) for name in names if name not in plan.peers)
    for words in dict.fromkeys(missing):
        print(words, file=sys.stderr)


def _run_ticks(options: argparse.Namespace, plan: Any, figures: Any = None) -> None:
    from benchmarks.result import format_table, write_figure
    from benchmarks.tick import bench_tick

    results, folder = _run(options, plan, bench_tick, format_table, figures)
    if figures is not None and not options.json:
        for figure in figures(results):
            print(figure.words())
    if folder is not None:
        write_figure(results, folder / "bench.png")


def _growth(options: argparse.Namespace) -> None:
    from benchmarks.growth import GrowthBench, bench_growth, format_growth_table

    _run(options, GrowthBench(**_given(options, "ticks")), bench_growth, format_growth_table)


def _dof(options: argparse.Namespace) -> None:
    from benchmarks.dof import DofBench, bench_dof, format_dof_table, speed_targets

    given = _given(options, "ticks", "stack")
    if options.joints is not None:
        given["joints"] = _numbers(options.joints)
    if options.contacts is not None:
        given["contacts"] = words_of(options.contacts)
    _run(options, DofBench(**given), bench_dof, format_dof_table, speed_targets)


def _batch(options: argparse.Namespace) -> None:
    from benchmarks.batch import BatchBench, batch_figures, bench_batch, format_batch_table
    from benchmarks.recording import STACKS

    if options.stack is not None and options.stack not in STACKS:
        raise UnknownNameError("no such stack", got=options.stack, choices=STACKS)
    plan = BatchBench(**_given(options, "robot", "stack", "ticks"))
    _run(options, plan, bench_batch, format_batch_table, batch_figures)


def _bias(options: argparse.Namespace) -> None:
    from benchmarks.bias import BiasBench, bench_bias, format_bias_table

    _run(options, BiasBench(**_given(options, "robot", "ticks")), bench_bias, format_bias_table)


def _teleop(options: argparse.Namespace) -> None:
    from benchmarks.teleop import TeleopBench, bench_teleop, format_teleop_table

    plan = TeleopBench(**_given(options, "robot", "ticks"))
    _run(options, plan, bench_teleop, format_teleop_table)


def _whole(options: argparse.Namespace) -> None:
    from benchmarks.running import RunBench, bench_run, format_run_table, run_figures

    plan = RunBench(**_given(options, "scenario", "robot"))
    _run(options, plan, bench_run, format_run_table, run_figures, "")


def _first(options: argparse.Namespace) -> None:
    from benchmarks.first import FirstBench, bench_first, first_figures, format_first_table

    plan = FirstBench(**_given(options, "robot", "controller"))
    _run(options, plan, bench_first, format_first_table, first_figures, " processes")


def _worst(options: argparse.Namespace) -> None:
    from benchmarks.worst import WorstBench, bench_worst, format_worst_table, worst_figures

    given = _given(options, "robot", "ticks")
    if options.scenarios is not None:
        given["scenarios"] = words_of(options.scenarios)
    _run(options, WorstBench(**given), bench_worst, format_worst_table, worst_figures)


def _run(
    options: argparse.Namespace,
    plan: Any,
    bench: Any,
    table: Any,
    more: Any = None,
    unit: str = " ticks",
) -> tuple[Any, Path | None]:
    """Times, prints, and writes `bench.json` where a folder is wanted.

    Args:
        options: of the command line.
        plan: what to time.
        bench: times it.
        table: makes a table of the results.
        more: makes further lines of JSON of them.
        unit: of the progress.

    Returns:
        The results, and the folder.
    """
    folder = folder_of(options.out)
    with Bar("timing", unit) as bar:
        results = bench(plan, bar)
    objects = [*results, *(more(results) if more is not None else ())]
    lines = "".join(json.dumps(one.to_json()) + "\n" for one in objects)
    print(lines if options.json else table(results), end="" if options.json else "\n")
    if folder is not None:
        (folder / "bench.json").write_text(lines, encoding="utf-8")
    return results, folder


def _given(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Options that were given; for the others the benchmark's own defaults hold."""
    return {name: getattr(options, name) for name in names if getattr(options, name) is not None}


def _numbers(text: str) -> tuple[int, ...]:
    """Reads `20,33,60`."""
    words = words_of(text)
    for word in words:
        if not (word.isascii() and word.isdigit()):
            raise ConfigurationError(
                "a number of joints is not a number", got=word, wanted="such as 20,33,60"
            )
    return tuple(int(word) for word in words)


def _stacks(name: str) -> tuple[str, ...]:
    from benchmarks.recording import STACKS

    return STACKS if name == "both" else (name,)


def _interpreters(text: str) -> dict[str, Path]:
    """Reads `name=path,name=path`; libdwbc's program stands for both its ways."""
    from benchmarks.peers.process import PROGRAMS

    peers: dict[str, Path] = {}
    for word in words_of(text):
        name, separator, path = word.partition("=")
        if not separator or not path:
            raise ConfigurationError(
                "a peer needs the Python of its environment, or its program",
                got=word,
                wanted="NAME=PATH, such as tsid=peers/tsid/bin/python",
            )
        for one in PROGRAMS if name == "libdwbc" else (name,):
            peers[one] = Path(path)
    return peers


if __name__ == "__main__":
    sys.exit(main())
