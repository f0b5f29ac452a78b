"""`TrialSection`: a part of a study that counts failures of trials, case by case.

`run_each`: its trials, in processes of their own, none of them lost.
"""

import hashlib
import pickle
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from scipy.stats import binomtest

import poise
import studies
from poise.apps.campaigns import LocalWorkers, RowLog
from poise.errors import PoiseError
from studies.finding import Cell, Finding, Section, Table
from studies.plan import Progress, StudyOptions

Trial = TypeVar("Trial")
Outcome = TypeVar("Outcome")


def has_fallen(outcome: Any) -> bool:
    """Failure of a trial by default: a fall."""
    return bool(outcome.fell)


def none(_outcomes: Sequence[Any]) -> float:
    """Allow no failure."""
    return 0.0


def part(share: float) -> Callable[[Sequence[Any]], float]:
    """Allow a share of the trials to fail."""
    return lambda outcomes: share * len(outcomes)


@dataclass(frozen=True, kw_only=True)
class Bound:
    """An upper bound on a figure of the outcomes of a case."""

    name: str  # of the figure
    value: Callable[[Sequence[Any]], float]  # computes it
    most: float  # its bound
    unit: str = ""  # of both
    note: str = ""  # added to the finding


@dataclass(frozen=True, kw_only=True)
class Case:
    """Trials that are judged together."""

    name: str  # of the case
    trials: Sequence[Any]  # of any hashable type
    # Failures that are allowed, by outcomes; None where nothing is asked of them
    allowed: Callable[[Sequence[Any]], float] | None = none
    failed: Callable[[Any], bool] = has_fallen  # tests an outcome for a failure
    what: str = "falls"  # a failure in words, in the plural
    bounds: tuple[Bound, ...] = ()  # figures beside the number of failures


@dataclass(frozen=True, kw_only=True)
class TrialSection:
    """Part of a study: a finding and a row of the table for each case."""

    title: str  # heading of the table
    prose: tuple[str, ...]  # paragraphs
    run: Callable[[Any], Any]  # runs one trial; a function of a module
    kind: type[Any]  # type of its outcome
    cases: Callable[[StudyOptions], Sequence[Case]]  # makes the cases
    # Further columns of the table, each a figure of the outcomes of a case
    columns: Mapping[str, Callable[[Sequence[Any]], Cell]] = field(
        default_factory=dict[str, Callable[[Sequence[Any]], Cell]]
    )

    def __call__(self, options: StudyOptions, progress: Progress) -> Section:
        """Run all trials and return the section."""
        cases = self.cases(options)
        # Cases may share trials, each of which is run once.
        trials = list(dict.fromkeys(trial for case in cases for trial in case.trials))
        found = run_each(self.run, self.kind, trials, progress, options)
        groups = [(case, [found[trial] for trial in case.trials]) for case in cases]
        return Section(
            prose=self.prose,
            findings=tuple(f for case, group in groups for f in findings_of(case, group)),
            tables=(
                Table(
                    title=self.title,
                    header=" | ".join(("case", "failures", *self.columns)),
                    rows=tuple(self._row(case, group) for case, group in groups),
                    caption="In brackets Wilson's interval of 95%.",
                ),
            ),
        )

    def _row(self, case: Case, group: Sequence[Any]) -> tuple[Cell, ...]:
        failures = sum(case.failed(outcome) for outcome in group)
        figures = (column(group) for column in self.columns.values())
        return (case.name, counted(failures, len(group)), *figures)


def findings_of(case: Case, outcomes: Sequence[Any]) -> list[Finding]:
    """Compare a case with what is asked of it."""
    findings: list[Finding] = []
    if case.allowed is not None:
        failures, allowed = sum(map(case.failed, outcomes)), case.allowed(outcomes)
        findings.append(
            Finding(
                name=f"{case.name}: {case.what} in {len(outcomes)} trials",
                paper=round(allowed, 2),
                ours=failures,
                ok=failures <= allowed,
                note=f"at most; {counted(failures, len(outcomes))}",
            )
        )
    for bound in case.bounds:
        value = float(bound.value(outcomes))
        findings.append(
            Finding(
                name=f"{case.name}: {bound.name}",
                paper=bound.most,
                ours=value,
                unit=bound.unit,
                ok=bool(value <= bound.most),
                note=f"at most; {bound.note or f'{len(outcomes)} trials'}",
            )
        )
    return findings


def counted(count: int, total: int) -> str:
    """Format a count with Wilson's interval of 95% for its share."""
    interval = binomtest(count, total).proportion_ci(method="wilson")
    return f"{count} of {total} ({100.0 * interval.low:.0f} to {100.0 * interval.high:.0f}%)"


def worst(attribute: str, scale: float = 1.0) -> Callable[[Sequence[Any]], float]:
    """Figure: the largest value of an attribute of outcomes, times a factor."""
    return lambda outcomes: scale * max(getattr(outcome, attribute) for outcome in outcomes)


def total(attribute: str, scale: float = 1.0) -> Callable[[Sequence[Any]], float]:
    """Figure: the sum of an attribute of outcomes, times a factor."""
    return lambda outcomes: scale * sum(getattr(outcome, attribute) for outcome in outcomes)


def median(attribute: str) -> Callable[[Sequence[Any]], float]:
    """Figure: the median of an attribute of outcomes."""
    return lambda outcomes: float(np.median([getattr(o, attribute) for o in outcomes]))


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
