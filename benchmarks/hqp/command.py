"""`python -m benchmarks hqp`: a race of methods for hierarchical problems."""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.commands import add_command, folder_of, words_of
from poise.cli import Bar
from poise.errors import ConfigurationError, MissingExtraError, UnknownNameError

_RACING = ("problems", "sequences", "methods", "count", "out", "json")
"""Options of a race; with `--save` only `--count` means something."""

MADE = 31
"""Problems of a sequence that is made, where `--count` says nothing: warm starts count 30."""


def add_hqp(commands: Any) -> None:
    """`hqp`: a race."""
    parser = add_command(
        commands,
        "hqp",
        _hqp,
        "races solvers on hierarchical problems of robots, of inverse kinematics and of chance, "
        "and judges their answers",
        "--methods daqp-hierarchical,cascade/osqp --out bench",
    )
    parser.add_argument(
        "--methods",
        metavar="M,M",
        help="such as cascade/osqp, daqp-hard, daqp-hierarchical, direct/solve (default: all that "
        "are installed); direct is always timed",
    )
    parser.add_argument(
        "--problems", metavar="FOLDER", help="race on the sequences saved there, not on new ones"
    )
    parser.add_argument(
        "--sequences",
        metavar="S,S",
        help="names of sequences (default: all of FOLDER, or a selection that is quickly made; "
        "all: every one that can be made)",
    )
    parser.add_argument(
        "--count",
        metavar="N",
        type=int,
        help=f"most problems of a sequence (default: {MADE}, or all of those in FOLDER)",
    )
    parser.add_argument(
        "--save", metavar="FOLDER", help="make all sequences and save them, race nothing"
    )


def _hqp(options: argparse.Namespace) -> None:
    if options.count is not None and options.count < 2:
        raise ConfigurationError("too few problems", got=options.count, wanted="--count 2 or more")
    if options.save is not None:
        _save(options)
    else:
        _race(options)


def _save(options: argparse.Namespace) -> None:
    from benchmarks.hqp.problem_sources import save_all

    for name in _RACING:
        if name != "count" and getattr(options, name):
            raise ConfigurationError(
                "--save makes problems and races nothing", got=f"--{name}", wanted="--count"
            )
    folder = Path(options.save)
    folder.mkdir(parents=True, exist_ok=True)
    with Bar("making problems", "") as bar:
        paths = save_all(folder, options.count or MADE, bar)
    print(f"{len(paths)} sequences in {folder}")


def _race(options: argparse.Namespace) -> None:
    from benchmarks.hqp.bench import HqpBench, bench_hqp, format_hqp_table
    from benchmarks.hqp.figure import write_profile_figure
    from benchmarks.hqp.methods import what_is_missing

    methods = words_of(options.methods) if options.methods is not None else None
    plan = HqpBench(methods=methods)
    folder = folder_of(options.out)
    sequences = _loaded(options) if options.problems else _made(options)
    with Bar("racing", " problems") as bar:
        race = bench_hqp(sequences, plan, bar)
    lines = "".join(json.dumps(result.to_json()) + "\n" for result in race.results)
    print(lines if options.json else format_hqp_table(race), end="" if options.json else "\n")
    if folder is not None:
        (folder / "hqp.json").write_text(lines, encoding="utf-8")
        write_profile_figure(race.laps, folder / "hqp.png")
    if methods is None:
        for reason in what_is_missing():
            print(f"left out: {reason}", file=sys.stderr)


def _loaded(options: argparse.Namespace) -> list[Any]:
    """Sequences of a folder, as many of their problems as are wanted."""
    from benchmarks.hqp.problem_set import load_folder

    sequences = {one.name: one for one in load_folder(Path(options.problems))}
    wanted = _names(options.sequences, tuple(sequences), tuple(sequences))
    return [
        replace(sequences[name], problems=sequences[name].problems[: options.count])
        for name in wanted
    ]


def _made(options: argparse.Namespace) -> list[Any]:
    """New sequences; of the usual ones those for which all is installed."""
    from benchmarks.hqp.problem_sources import USUAL_SEQUENCES, make_sequence, sequence_names

    wanted = _names(options.sequences, sequence_names(), USUAL_SEQUENCES)
    made: list[Any] = []
    with Bar("making problems", " sequences") as bar:
        for i, name in enumerate(wanted):
            bar(float(i), float(len(wanted)))
            try:
                made.append(make_sequence(name, options.count or MADE))
            except MissingExtraError as reason:
                if options.sequences is not None:
                    raise
                print(f"left out {name}: {reason}", file=sys.stderr)
    return made


def _names(text: str | None, choices: tuple[str, ...], usual: tuple[str, ...]) -> tuple[str, ...]:
    """Reads `a,b` or `all`."""
    if text is None:
        return usual
    names = choices if text == "all" else words_of(text)
    for name in names:
        if name not in choices:
            raise UnknownNameError(
                "unknown sequence of problems", got=name, choices=(*choices, "all")
            )
    return tuple(dict.fromkeys(names))
