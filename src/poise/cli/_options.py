"""Options that several verbs share, what they can be, and the checks of their values."""

import argparse
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from poise.control import CONTROLLERS
from poise.errors import ConfigurationError

BY_HAND = "step_teleoperation"
"""The controller that is none of `CONTROLLERS`: its name here, for to ask for it takes seconds."""


def controllers_text() -> str:
    """Which controllers a scenario can have, for a help."""
    return f"{', '.join(CONTROLLERS)}, or {BY_HAND} where an operator leads the robot's feet"


def strategies_text() -> str:
    """How each controller can solve, for a help."""
    names: dict[tuple[str, ...], list[str]] = {}
    for name, kind in CONTROLLERS.items():
        names.setdefault(kind.strategies, []).append(name)
    said = (f"{', '.join(how)} ({', '.join(who)})" for how, who in names.items())
    return "; ".join(said)


def add_output_options(parser: argparse.ArgumentParser, default: str) -> None:
    """Adds `--out` and `--json`."""
    parser.add_argument("--out", metavar="DIR", help=f"folder to write into (default: {default})")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")


def add_worker_options(parser: argparse.ArgumentParser) -> None:
    """Adds `--scheduler`, `--slurm` and `--workers`, for `make_workers`."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="address of a Dask cluster, as in tcp://10.0.0.1:8786",
    )
    where.add_argument(
        "--slurm",
        action="store_true",
        help="submit --workers jobs to Slurm; sbatch reads its options from SBATCH_PARTITION, "
        "SBATCH_TIMELIMIT, ...",
    )
    parser.add_argument(
        "--workers",
        metavar="N",
        type=whole_number,
        help="how many processes (default: one a core), or jobs, where --slurm wants a number",
    )


def make_workers(options: argparse.Namespace) -> Any:
    """Who works, as the command line says."""
    from poise.apps.campaigns import DaskWorkers, LocalWorkers, SlurmWorkers

    if options.scheduler is not None:
        if options.workers is not None:
            raise ConfigurationError(
                "a cluster has its own number of workers",
                got=options.workers,
                wanted="no --workers",
            )
        return DaskWorkers(options.scheduler)
    if options.slurm:
        if options.workers is None:
            raise ConfigurationError("--slurm asks for so many jobs", wanted="--workers N")
        return SlurmWorkers(options.workers)
    return LocalWorkers(options.workers)


@contextmanager
def output_folder(given: Path | str | None, default: Path | str) -> Generator[Path]:
    """The folder to write into for a `with` block, made if it is not there.

    What was made for it is taken away again where nothing was written, as by a refused command.
    """
    folder = Path(given or default)
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield folder
    finally:
        for place in made:
            with suppress(OSError):  # One that holds something stays.
                place.rmdir()


def whole_number(text: str) -> int:
    """A whole number >= 0 of the command line."""
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"got {text!r}, wanted 0, 1, 2, ...")
    return int(text)
