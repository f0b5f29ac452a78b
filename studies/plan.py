"""`StudyPlan`: a study's parts, and running them so that nothing computed is lost.

`Study`: what it found. `Steps`: the progress of a part that consists of several runs.
"""

import traceback
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

from poise.errors import ConfigurationError, PoiseError, UnknownNameError
from studies.finding import Finding, Section, require_matplotlib


@dataclass(frozen=True, kw_only=True)
class Unfinished:
    """A part of a study that has no result."""

    name: str  # id of the part
    title: str  # its heading
    reason: str  # why, in one line
    details: str = ""  # the traceback where an error was the reason

    def finding(self) -> Finding:
        """The part's place in the list of findings: one that does not hold."""
        return Finding(
            name=f"part {self.name!r} of the study",
            ours=None,
            ok=False,
            note=f"{self.title}: {self.reason}",
        )


Progress = Callable[[float, float], None]
"""Says how far a part is: what is done, and the whole, in any unit."""
ShowProgress = Callable[[str], AbstractContextManager[Progress]]
"""Makes the progress of the part with this title."""

_NOT_COMPUTED = "not computed"


@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """Options of a run of a study."""

    # Shorter motions and fewer samples, for tests; claims are checked all the same
    quick: bool = False
    seed: int = 0  # of everything random, a whole number >= 0
    # How many seeds a case has, where a part goes through several; None for the part's own number
    seeds: int | None = None
    # Where outcomes of trials are kept, and taken from when the study is run again; None for
    # nowhere
    folder: Path | None = None
    # File with a row for each run, of studies that have one; in `folder` when None
    rows: Path | None = None
    processes: int | None = None  # how many make runs, in studies that ask; one a core when None

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ConfigurationError("a seed cannot be negative", got=self.seed, wanted=">= 0")
        if self.seeds is not None and self.seeds < 1:
            raise ConfigurationError("a case needs a seed", got=self.seeds, wanted=">= 1")
        if self.processes is not None and self.processes < 1:
            raise ConfigurationError("nobody makes runs", got=self.processes, wanted=">= 1")

    @property
    def first_seed(self) -> int:
        """The seed of the first trial, where a part goes through several: other `seed`, other ones.

        What was tuned was tuned on seeds from 100,000 to 100,999, which no `seed` reaches.
        """
        return 1_000_000 * self.seed

    def count(self, full: int, quick: int) -> int:
        """Number of seeds of a case."""
        if self.seeds is not None:
            return self.seeds
        return quick if self.quick else full


@dataclass(frozen=True)
class Part:
    """One part of a study, to be computed."""

    name: str  # its id, unique within the study
    title: str  # heading of its section
    compute: Callable[[StudyOptions, Progress], Section]  # gives the section


@dataclass(frozen=True, kw_only=True)
class StudyPlan:
    """A study before it is run."""

    name: str  # as the command line has it
    title: str  # heading of its page
    introduction: tuple[str, ...]  # paragraphs of plain text, as in sections
    source: str  # the paper, as one cites it
    parts: tuple[Part, ...]  # in the order in which they are computed and shown

    def only(self, names: Sequence[str]) -> "StudyPlan":
        """The plan of some of its parts."""
        choices = [part.name for part in self.parts]
        for name in names:
            if name not in choices:
                raise UnknownNameError(f"unknown part of {self.name}", got=name, choices=choices)
        return replace(self, parts=tuple(part for part in self.parts if part.name in names))

    def run(
        self,
        options: StudyOptions,
        show: ShowProgress | None = None,
        save: Callable[["Study"], object] | None = None,
    ) -> "Study":
        """Computes part by part; one that fails is reported and the next ones still run."""
        require_matplotlib()
        outcomes: list[Section | Unfinished] = [
            Unfinished(name=part.name, title=part.title, reason=_NOT_COMPUTED)
            for part in self.parts
        ]
        for index, part in enumerate(self.parts):
            if save is not None:
                save(Study(self, options, tuple(outcomes)))
            with nullcontext(_silent) if show is None else show(part.title) as progress:
                outcomes[index] = _outcome(part, options, progress)
        study = Study(self, options, tuple(outcomes))
        if save is not None:
            save(study)
        return study


@dataclass(frozen=True)
class Study:
    """Findings of a study, complete or as far as it came."""

    plan: StudyPlan  # what was to be computed
    options: StudyOptions  # length and seed
    outcomes: tuple[Section | Unfinished, ...]  # of the parts, in order

    @property
    def sections(self) -> tuple[Section, ...]:
        """The parts that are done."""
        return tuple(o for o in self.outcomes if isinstance(o, Section))

    @property
    def unfinished(self) -> tuple[Unfinished, ...]:
        """The parts that failed or were not computed."""
        return tuple(o for o in self.outcomes if isinstance(o, Unfinished))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings in order; behind them one that does not hold for each unfinished part."""
        done = tuple(finding for section in self.sections for finding in section.findings)
        return done + tuple(part.finding() for part in self.unfinished)

    @property
    def ok(self) -> bool:
        """Whether every part was computed and every finding holds."""
        return all(finding.ok for finding in self.findings)


def _outcome(part: Part, options: StudyOptions, progress: Progress) -> Section | Unfinished:
    try:
        section = part.compute(options, progress)
    except PoiseError as error:
        return Unfinished(name=part.name, title=part.title, reason=f"failed: {error}")
    except Exception as error:
        # Parts take minutes and do not depend on each other: whatever is wrong in one must not
        # take the results of the others along. It is reported in full and fails the study.
        return Unfinished(
            name=part.name,
            title=part.title,
            reason=f"failed: {type(error).__name__}: {error}",
            details=traceback.format_exc(),
        )
    return replace(section, name=part.name, title=part.title)


def _silent(_done: float, _total: float) -> None:
    """Progress that nobody wants to see."""


class Steps:
    """Counts runs, and shares of the run at hand."""

    def __init__(self, progress: Progress, count: int) -> None:
        self._progress, self._count, self._done = progress, count, -1

    def next(self) -> Callable[[float], None]:
        """Begins the next run; what comes back is told the share of it that is done."""
        self._done += 1
        done = self._done
        self._progress(float(done), float(self._count))
        return lambda share: self._progress(done + share, float(self._count))

    def finish(self) -> None:
        """Says that all is done."""
        self._progress(float(self._count), float(self._count))


_MODULES = {
    "bias-acceleration": "studies.bias_acceleration",
    "step-teleoperation": "studies.step_teleoperation",
    "reduced-dynamics": "studies.reduced_dynamics",
    "torque-teleoperation": "studies.torque_teleoperation",
    "locomotion": "studies.locomotion",
    "quiet": "studies.quiet",
    "ablation": "studies.ablation",
    "g1-link": "studies.g1_link",
}
"""Where each study's `PLAN` is."""

STUDIES = tuple(_MODULES)
"""Names of the studies."""


def load_study(name: str) -> StudyPlan:
    """The plan of a study."""
    if name not in _MODULES:
        raise UnknownNameError("unknown study", got=name, choices=STUDIES)
    return import_module(_MODULES[name]).PLAN
