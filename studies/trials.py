"""`run_each`: the trials of a part of a study, in processes of their own, none of them lost."""

import hashlib
import pickle
from base64 import b64decode, b64encode
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TypeVar

import poise
import studies
from poise.apps.campaigns import LocalWorkers, RowLog
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
    """Run a function of a module, `run`, with each of the trials that no former run has done.

    `progress` counts trials. Outcomes of that `kind` are kept in the folder of the `options`, if
    any, and come in the order of the trials; they do not depend on the number of workers, one a
    core when None. A trial that has ended every process that tried it raises a `PoiseError`.
    """
    log, outcomes = None, dict[Trial, Outcome]()
    if options is not None and options.folder is not None:
        module = (run.__module__ or "").removeprefix("studies.")
        log = RowLog(options.folder / "trials" / f"{module}.{run.__name__}-{_code()}.jsonl")
        outcomes |= (pickle.loads(b64decode(row["pickle"])) for row in log.rows)
    left = [trial for trial in trials if trial not in outcomes]
    with LocalWorkers(workers) as crew:
        for done, (trial, outcome) in enumerate(crew.each(run, left), len(trials) - len(left) + 1):
            if not isinstance(outcome, kind):
                raise PoiseError(f"no outcome of {trial}: {outcome}")
            outcomes[trial] = outcome
            if log is not None:
                log.add({"pickle": b64encode(pickle.dumps((trial, outcome))).decode()})
            progress(float(done), float(len(trials)))
    return {trial: outcomes[trial] for trial in trials}


@cache
def _code() -> str:
    """The first letters of a digest of the sources of Poise and of all studies."""
    digest = hashlib.sha256()
    for root in (Path(package.__path__[0]) for package in (poise, studies)):
        for path in sorted([*root.rglob("*.py"), *root.rglob("*.yaml")]):
            digest.update(f"{path.relative_to(root)}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:8]
