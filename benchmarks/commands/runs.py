"""Commands that time whole runs, first uses and single formulas."""

import argparse
from typing import Any

from benchmarks.commands.timing import add_command, given, time_and_print, words_of


def add_first(commands: Any) -> None:
    """`first`: what a user waits for before the first tick."""
    parser = add_command(
        commands,
        "first",
        _first,
        "times import and first controller, from an empty cache and in a second process",
        "--controller osf",
    )
    parser.add_argument("--robot", metavar="R", help="any (default: humanoid33)")
    parser.add_argument(
        "--controller",
        metavar="C",
        help="whole_body (default), reduced, osf or differential_ik",
    )


def _first(options: argparse.Namespace) -> None:
    from benchmarks.first import FirstBench, bench_first, first_figures, format_first_table

    plan = FirstBench(**given(options, "robot", "controller"))
    time_and_print(options, plan, bench_first, format_first_table, first_figures, " processes")


def add_teleop(commands: Any) -> None:
    """`teleop`: the step teleoperator, which is no resolver of tasks: it walks."""
    parser = add_command(
        commands,
        "teleop",
        _teleop,
        "times the step teleoperator on a recorded walk over an obstacle, and the whole simulation "
        "of that walk against real time",
        "--robot g1",
    )
    parser.add_argument("--robot", metavar="R", help="a biped (default: biped20)")
    parser.add_argument("--actuation", metavar="A", help="torque (default) or velocity")
    parser.add_argument("--ticks", metavar="N", type=int, help="timed ticks (default: one walk)")


def _teleop(options: argparse.Namespace) -> None:
    from benchmarks.teleop import TeleopBench, bench_teleop, format_teleop_table

    plan = TeleopBench(**given(options, "robot", "ticks", "actuation"))
    time_and_print(options, plan, bench_teleop, format_teleop_table)


def add_latency(commands: Any) -> None:
    """`latency`: from an operator's pose to the robot's command."""
    parser = add_command(
        commands,
        "latency",
        _latency,
        "times what an operator sends over the websocket, stage by stage, until the robot has its "
        "command",
        "--actuation torque",
    )
    parser.add_argument("--robot", metavar="R", help="a biped (default: biped20)")
    parser.add_argument("--actuation", metavar="A", help="velocity (default) or torque")
    parser.add_argument(
        "--messages", metavar="N", type=int, help="messages that count (default: 1000)"
    )
    parser.add_argument("--rate", metavar="HZ", type=float, help="of the messages (default: 60)")


def _latency(options: argparse.Namespace) -> None:
    from benchmarks.latency import (
        LatencyBench,
        bench_latency,
        format_latency_table,
        latency_figures,
    )

    plan = LatencyBench(**given(options, "robot", "actuation", "messages", "rate"))
    time_and_print(options, plan, bench_latency, format_latency_table, latency_figures, " messages")


def add_keys(commands: Any) -> None:
    """`keys`: from a key in a browser to what a driven robot is asked for."""
    parser = add_command(
        commands,
        "keys",
        _keys,
        "presses a key in a browser without a screen, and times how soon the robot that is driven "
        "is asked for another velocity",
        "--presses 20",
    )
    parser.add_argument("--robot", metavar="R", help="a humanoid (default: g1)")
    parser.add_argument("--presses", metavar="N", type=int, help="presses that count (default: 40)")


def _keys(options: argparse.Namespace) -> None:
    from benchmarks.keys import KeysBench, bench_keys, format_keys_table, keys_figures

    plan = KeysBench(**given(options, "robot", "presses"))
    time_and_print(options, plan, bench_keys, format_keys_table, keys_figures, " presses")


def add_run(commands: Any) -> None:
    """`run`: where the time of a scenario goes."""
    parser = add_command(
        commands,
        "run",
        _run,
        "times a whole scenario, recorded and logged, by processor time and by parts",
        "--scenario walk --robot g1",
    )
    parser.add_argument(
        "--scenario", metavar="S", help="a shipped scenario or a YAML file (default: walk)"
    )
    parser.add_argument("--robot", metavar="R", help="another than the scenario's")


def _run(options: argparse.Namespace) -> None:
    from benchmarks.running import RunBench, bench_run, format_run_table, run_figures

    plan = RunBench(**given(options, "scenario", "robot"))
    time_and_print(options, plan, bench_run, format_run_table, run_figures, "")


def add_worst(commands: Any) -> None:
    """`worst`: the slowest ticks of scenarios."""
    parser = add_command(
        commands,
        "worst",
        _worst,
        "finds the worst tick of many runs of the same scenarios",
        "--scenarios push,walk",
    )
    parser.add_argument(
        "--scenarios",
        metavar="S,S",
        help="shipped scenarios or YAML files (default: seven of torque controllers)",
    )
    parser.add_argument("--robot", metavar="R", help="another than the scenarios'")
    parser.add_argument(
        "--ticks", metavar="N", type=int, help="ticks of each scenario (default: 100000)"
    )


def _worst(options: argparse.Namespace) -> None:
    from benchmarks.worst import WorstBench, bench_worst, format_worst_table, worst_figures

    wanted = given(options, "robot", "ticks")
    if options.scenarios is not None:
        wanted["scenarios"] = words_of(options.scenarios)
    time_and_print(options, WorstBench(**wanted), bench_worst, format_worst_table, worst_figures)


def add_bias(commands: Any) -> None:
    """`bias`: formulas of the bias acceleration."""
    parser = add_command(
        commands,
        "bias",
        _bias,
        "times the formulas of the bias acceleration on a recorded run of a robot on a fixed base",
        "--robot upper17",
    )
    parser.add_argument(
        "--robot", metavar="R", help="a robot on a fixed base with hands (default: upper17)"
    )
    parser.add_argument("--ticks", metavar="N", type=int, help="timed ticks (default: 1100)")


def _bias(options: argparse.Namespace) -> None:
    from benchmarks.bias import BiasBench, bench_bias, format_bias_table

    plan = BiasBench(**given(options, "robot", "ticks"))
    time_and_print(options, plan, bench_bias, format_bias_table)
