"""`add_command`, and `time_and_print`: what the commands of all benchmarks have in common."""

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from poise.cli import Bar


def add_command(
    commands: Any, name: str, act: Callable[[argparse.Namespace], None], does: str, example: str
) -> argparse.ArgumentParser:
    """Adds a benchmark to the command line, with the options that all have.

    Args:
        commands: of the command line.
        name: of the benchmark.
        act: times and prints.
        does: what it times, in a sentence without its subject.
        example: its options in an example.

    Returns:
        Its parser.
    """
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


def given(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Options that were given; for the others the benchmark's own defaults hold."""
    return {name: getattr(options, name) for name in names if getattr(options, name) is not None}


def words_of(text: str) -> tuple[str, ...]:
    """Reads `a,b,c`: words with commas between them."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def folder_of(wanted: str | None) -> Path | None:
    """The folder to write into, made if it is not there; None for none."""
    if wanted is None:
        return None
    folder = Path(wanted)
    folder.mkdir(parents=True, exist_ok=True)
    return folder
