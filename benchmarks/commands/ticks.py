"""Commands that time ticks of the controllers of tasks, and other packages beside them."""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.commands.timing import add_command, given, time_and_print, words_of
from poise.errors import ConfigurationError, UnknownNameError


def add_tick(commands: Any) -> None:
    """`tick`: one controller by different solvers."""
    parser = add_command(
        commands,
        "tick",
        _tick,
        "times a controller's tick from state to command, by phase, on a recorded moving run",
        "--controller reduced",
    )
    _add_motion(parser, "humanoid33", 500)
    _add_stacks(parser, "both (default)")
    parser.add_argument(
        "--controller", metavar="C", help="whole_body (default), reduced, osf or differential_ik"
    )
    parser.add_argument(
        "--methods",
        metavar="M,M",
        help="such as cascade/osqp,cascade/proxqp,weighted; direct is always timed",
    )
    _add_peers(parser, "tsid=PATH,placo=PATH,libdwbc=PATH, or of inverse kinematics mink, pink")


def _tick(options: argparse.Namespace) -> None:
    from benchmarks.tick import TickBench
    from poise.control import CONTROLLERS

    if options.controller is not None and options.controller not in CONTROLLERS:
        raise UnknownNameError(
            "no such controller", got=options.controller, choices=tuple(CONTROLLERS)
        )
    plan = TickBench(
        **given(options, "robot", "contacts", "controller", "ticks"),
        stacks=_stacks(options.stack or "both"),
        methods=words_of(options.methods) if options.methods else None,
        peers=_interpreters(options.peers or ""),
    )
    _time_ticks(options, plan)


def add_peers(commands: Any) -> None:
    """`peers`: other packages beside the full and the reduced controller."""
    parser = add_command(
        commands,
        "peers",
        _peers,
        "times TSID, placo and libdwbc beside the full and the reduced controller",
        "--peers tsid=peers/tsid/bin/python",
    )
    _add_motion(parser, "humanoid33", 500)
    _add_stacks(parser, "both (default: table1)")
    _add_peers(parser, "tsid=PATH,placo=PATH,libdwbc=PATH")


def _peers(options: argparse.Namespace) -> None:
    from benchmarks.peers.process import TORQUE_PEERS
    from benchmarks.tick import TickBench, peer_figures

    plan = TickBench(
        **given(options, "robot", "contacts", "ticks"),
        controller="reduced",
        stacks=_stacks(options.stack or "table1"),
        methods=("direct",),
        peers=_peers_at_hand(options, TORQUE_PEERS),
    )
    _time_ticks(options, plan, peer_figures)
    _say_who_is_missing(plan, TORQUE_PEERS)


def add_ik(commands: Any) -> None:
    """`ik`: other packages beside differential inverse kinematics."""
    parser = add_command(
        commands,
        "ik",
        _ik,
        "times mink and pink beside every method of differential inverse kinematics",
        "--peers mink=peers/mink/bin/python",
    )
    _add_motion(parser, "g1", 500)
    _add_stacks(parser, "both (default)")
    _add_peers(parser, "mink=PATH,pink=PATH")


def _ik(options: argparse.Namespace) -> None:
    from benchmarks.peers.process import VELOCITY_PEERS
    from benchmarks.tick import TickBench, velocity_figures
    from poise.control import CONTROLLERS

    plan = TickBench(
        **given(options, "contacts", "ticks"),
        robot=options.robot or "g1",
        controller="differential_ik",
        stacks=_stacks(options.stack or "both"),
        methods=CONTROLLERS["differential_ik"].strategies,
        peers=_peers_at_hand(options, VELOCITY_PEERS),
    )
    _time_ticks(options, plan, velocity_figures)
    _say_who_is_missing(plan, VELOCITY_PEERS)


def add_growth(commands: Any) -> None:
    """`growth`: one number varied at a time."""
    parser = add_command(
        commands,
        "growth",
        _growth,
        "times how a tick grows with joints, levels, tasks and contacts",
        "--ticks 200",
    )
    parser.add_argument("--ticks", metavar="N", type=int, help="timed ticks (default: 400)")


def _growth(options: argparse.Namespace) -> None:
    from benchmarks.growth import GrowthBench, bench_growth, format_growth_table

    plan = GrowthBench(**given(options, "ticks"))
    time_and_print(options, plan, bench_growth, format_growth_table)


def add_dof(commands: Any) -> None:
    """`dof`: the full and the reduced controller by joints."""
    parser = add_command(
        commands,
        "dof",
        _dof,
        "times the full and the reduced controller on robots of 20 to 60 joints",
        "--joints 33,60",
    )
    parser.add_argument("--joints", metavar="N,N", help="of the robots (default: ten of them)")
    parser.add_argument(
        "--contacts", metavar="C,C", help="double, single or double,single (default)"
    )
    parser.add_argument("--stack", metavar="S", help="table1 (default) or default")
    parser.add_argument("--ticks", metavar="N", type=int, help="timed ticks (default: 300)")


def _dof(options: argparse.Namespace) -> None:
    from benchmarks.dof import DofBench, bench_dof, format_dof_table, speed_targets

    wanted = given(options, "ticks", "stack")
    if options.joints is not None:
        wanted["joints"] = _numbers(options.joints)
    if options.contacts is not None:
        wanted["contacts"] = words_of(options.contacts)
    time_and_print(options, DofBench(**wanted), bench_dof, format_dof_table, speed_targets)


def add_batch(commands: Any) -> None:
    """`batch`: many states in one call."""
    parser = add_command(
        commands,
        "batch",
        _batch,
        "times many states in one call beside single ticks, on one thread and on two",
        "--robot g1",
    )
    parser.add_argument("--robot", metavar="R", help="a biped (default: g1)")
    parser.add_argument("--stack", metavar="S", help="table1 or default (default)")
    parser.add_argument("--ticks", metavar="N", type=int, help="states of one (default: 4096)")


def _batch(options: argparse.Namespace) -> None:
    from benchmarks.batch import BatchBench, batch_figures, bench_batch, format_batch_table
    from benchmarks.recording import STACKS

    if options.stack is not None and options.stack not in STACKS:
        raise UnknownNameError("no such stack", got=options.stack, choices=STACKS)
    plan = BatchBench(**given(options, "robot", "stack", "ticks"))
    time_and_print(options, plan, bench_batch, format_batch_table, batch_figures)


# --- what several of them take ----------------------------------------------------------------


def _add_motion(parser: argparse.ArgumentParser, robot: str, ticks: int) -> None:
    parser.add_argument("--robot", metavar="R", help=f"a biped (default: {robot})")
    parser.add_argument("--contacts", metavar="C", help="double (default) or single")
    parser.add_argument("--ticks", metavar="N", type=int, help=f"timed ticks (default: {ticks})")


def _add_stacks(parser: argparse.ArgumentParser, both: str) -> None:
    parser.add_argument("--stack", metavar="S", help=f"table1, default or {both}")


def _add_peers(parser: argparse.ArgumentParser, example: str) -> None:
    parser.add_argument(
        "--peers",
        metavar="P=PATH",
        help=f"other packages and the Python of their environment, or their program: {example}",
    )


def _time_ticks(options: argparse.Namespace, plan: Any, figures: Any = None) -> None:
    from benchmarks.result import format_table, write_figure
    from benchmarks.tick import bench_tick

    results, folder = time_and_print(options, plan, bench_tick, format_table, figures)
    if figures is not None and not options.json:
        for figure in figures(results):
            print(figure.words())
    if folder is not None:
        write_figure(results, folder / "bench.png")


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
