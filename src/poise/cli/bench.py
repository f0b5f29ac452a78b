"""`poise bench`: timings, interleaved in one run."""

import argparse
import json
from pathlib import Path
from typing import Any

from poise.cli.options import add_output_options, make_folder
from poise.cli.progress import Bar
from poise.errors import ConfigurationError, UnknownNameError

_NAMES = ("tick",)
"""Benchmarks by name."""


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "bench",
        help="timings, interleaved in one run",
        description="tick: times a controller's tick from state to command, by phase, on a "
        "recorded moving run. All methods are timed tick by tick in turn on the same states.",
        epilog="example: poise bench tick --robot talos --peers tsid=peers/tsid/bin/python",
    )
    parser.add_argument("name", metavar="NAME", help="what to time: " + ", ".join(_NAMES))
    parser.add_argument(
        "--robot", metavar="R", default="humanoid33", help="a biped (default: %(default)s)"
    )
    parser.add_argument(
        "--contacts", metavar="C", default="double", help="double or single (default: %(default)s)"
    )
    parser.add_argument(
        "--controller", metavar="C", default="whole_body", help="default: %(default)s"
    )
    parser.add_argument(
        "--stack",
        metavar="S",
        default="both",
        help="table1, default or both (default: %(default)s)",
    )
    parser.add_argument(
        "--methods",
        metavar="M,M",
        help="such as cascade/osqp,cascade/proxqp,weighted; direct is always timed",
    )
    parser.add_argument(
        "--peers",
        metavar="P=PYTHON",
        help="other packages and the Python of their environment: tsid=PATH,placo=PATH",
    )
    parser.add_argument(
        "--ticks", metavar="N", type=int, default=500, help="timed ticks (default: %(default)s)"
    )
    add_output_options(parser, "none is written")
    parser.set_defaults(act=act)


def act(options: argparse.Namespace) -> int:
    """Runs a benchmark."""
    if options.name not in _NAMES:
        raise UnknownNameError("unknown benchmark", got=options.name, choices=_NAMES)
    from poise.bench import DEFAULT_METHODS, STACKS, TickBench, bench_tick, format_table

    plan = TickBench(
        robot=options.robot,
        contacts=options.contacts,
        controller=options.controller,
        stacks=STACKS if options.stack == "both" else (options.stack,),
        methods=_words(options.methods) if options.methods else DEFAULT_METHODS,
        peers=_peers(options.peers or ""),
        ticks=options.ticks,
    )
    folder = make_folder(options.out, ".") if options.out else None
    with Bar("timing", " ticks") as bar:
        results = bench_tick(plan, bar)
    lines = [json.dumps(result.to_json()) for result in results]
    print("\n".join(lines) if options.json else format_table(results))
    if folder is not None:
        from poise.bench import write_figure

        (folder / "bench.json").write_text("\n".join(lines) + "\n", encoding="utf-8")
        write_figure(results, folder / "bench.png")
    return 0


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
