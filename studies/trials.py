"""`run_each`: the trials of a part of a study, in processes of their own, none of them lost."""

import hashlib
import pickle
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import poise
import studies
from poise.apps.campaigns import LocalWorkers
from poise.errors import PoiseError
from studies.plan import Progress, StudyOptions

Trial = TypeVar("Trial")
Outcome = TypeVar("Outcome")


def run_each(
    run: Callable[[Trial], Outcome],
    kind: type[Outcome],
    trials: Sequence[Trial],
    progress: Progress,
    options: StudyOptions | None = None,
    *,
    workers: int | None = None,
) -> dict[Trial, Outcome]:
    """Runs trials, as many at a time as there are cores; what a former run has done is not again.

    Args:
        run: one of them; a function of a module.
        kind: of its outcome.
        trials: in any order.
        progress: told how many are done.
        options: of the study, which say where outcomes are kept; nowhere when None.
        workers: processes; one a core when None.

    Returns:
        Outcomes in the order of the trials; they do not depend on the number of processes.

    Raises:
        PoiseError: a trial has ended every process that tried it.
    """
    kept = None if options is None or options.folder is None else _file(options.folder, run)
    outcomes = _read(kept, kind)
    left = [trial for trial in trials if trial not in outcomes]
    with LocalWorkers(workers) as crew:
        begun = len(trials) - len(left)
        for done, (trial, outcome) in enumerate(crew.each(run, left), start=begun + 1):
            if not isinstance(outcome, kind):
                raise PoiseError(f"no outcome of {trial}: {outcome}")
            outcomes[trial] = outcome
            if kept is not None:
                _append(kept, trial, outcome)
            progress(float(done), float(len(trials)))
    return {trial: outcomes[trial] for trial in trials}


def _file(folder: Path, run: Callable[..., object]) -> Path:
    """Where outcomes of a function are kept; other code has another file, and its results stay."""
    module = (run.__module__ or "").removeprefix("studies.")
    return folder / "trials" / f"{module}.{run.__name__}-{_code()}.pickle"


@cache
def _code() -> str:
    """The first letters of a digest of the sources of Poise and of all studies."""
    digest = hashlib.sha256()
    for package in (poise, studies):
        root = Path(package.__path__[0])
        for path in sorted([*root.rglob("*.py"), *root.rglob("*.yaml")]):
            digest.update(f"{path.relative_to(root)}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:8]


def _append(path: Path, trial: object, outcome: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("ab") as file:
        file.write(pickle.dumps((trial, outcome)))


def _read(path: Path | None, kind: type[Outcome]) -> dict[Any, Outcome]:
    """What is kept; a record that a run left unfinished as it died, and what follows it, is cut."""
    if path is None or not path.exists():
        return {}
    found: dict[Any, Outcome] = {}
    with path.open("r+b") as file:
        whole = 0
        for trial, outcome in _records(file):
            whole = file.tell()
            if isinstance(outcome, kind):
                found[trial] = outcome
        file.truncate(whole)
    return found


def _records(file: BinaryIO) -> Iterator[tuple[Any, object]]:
    """Trials and outcomes, up to one that is not whole."""
    while True:
        try:
            yield pickle.load(file)
        except (EOFError, pickle.UnpicklingError):
            return
