"""`Card`: the results of a scorecard, as a file that cards are compared by."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from poise._schema import Bounds, Number, Text, Truth, checked, read
from poise._yaml import read_text
from poise.apps.pages import replace_file
from poise.errors import ConfigurationError

CARD, PAGE = "scorecard.json", "scorecard.html"
"""File names in a card's folder."""

Limit = Literal["", "at least", "none"]
"""Result for an amount: a limit, the hard end survived, or the easy end failed."""

_SIDES = {0.0: "ahead", 90.0: "left", 180.0: "back", 270.0: "right"}
"""Directions that have a name, anticlockwise from ahead [deg]."""

_Share = Annotated[float, Bounds(least=0.0, most=1.0)]
_Whole = Annotated[int, Bounds(least=0.0, whole=True, most=1e15)]


@checked()
@dataclass(frozen=True, kw_only=True)
class SeedResult:
    """The result of one seed."""

    amount: Number  # hardest one survived, the easy end where none was; 1 or 0 of counted seeds
    limit: Limit = ""


@checked()
@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """The result in one direction, at one phase."""

    angle: Number | None = None  # anticlockwise from ahead [deg]
    phase: _Share | None = None  # of the step, from lift-off (0) to the next (1)
    median: Number  # of the seeds' amounts; of a trial that counts seeds their share
    low: Number  # lower end of its interval, in the order of the numbers
    high: Number
    confidence: _Share  # of the interval
    level: _Share  # of the median, between the easy end (0) and the hard one (1)
    limit: Limit  # of the median
    seeds: tuple[SeedResult, ...]
    episode: _Whole | None = None  # number of the failed one nearest to the largest survived
    mechanism: str = ""  # of that episode

    @property
    def label(self) -> str:
        """Its name among the cases of its trial."""
        parts = [] if self.phase is None else [f"phase {self.phase:g}"]
        if self.angle is not None:
            parts.append(_SIDES.get(self.angle, f"{self.angle:g}°"))
        return ", ".join(parts)


@checked()
@dataclass(frozen=True, kw_only=True)
class TrialResult:
    """The results of a trial."""

    name: Text
    title: Text
    unit: str
    easy: Number
    hard: Number
    cases: tuple[CaseResult, ...]

    def named(self, case: CaseResult) -> str:
        """The name of a case among those of all trials."""
        return f"{self.title} {case.label}".strip()


@checked()
@dataclass(frozen=True, kw_only=True)
class Card:
    """A scorecard."""

    robot: Text
    controller: Text
    strategy: Text | None = None  # the controller's default when None
    version: Text  # of Poise
    trials_version: _Whole  # of the table of trials
    quick: Truth  # made with few seeds and looks
    trials: tuple[TrialResult, ...]  # in the table's order
    left_out: dict[Text, str]  # reasons by name of the trial

    @property
    def how(self) -> str:
        """Controller and strategy."""
        return f"{self.controller} ({self.strategy})" if self.strategy else self.controller

    @property
    def title(self) -> str:
        """Controller, strategy and version."""
        return f"{self.how}, {self.version}"

    @property
    def worst(self) -> tuple[TrialResult, CaseResult] | None:
        """The case nearest to the easy end of its trial; None of an empty card."""
        cases = [(trial, case) for trial in self.trials for case in trial.cases]
        return min(cases, key=lambda pair: pair[1].level, default=None)

    def write(self, folder: Path) -> Path:
        """Write the card's file into a folder, whole or not at all."""
        return replace_file(folder / CARD, json.dumps(asdict(self), indent=1) + "\n")


def read_card(path: Path) -> Card:
    """A card from its file, or from the folder with the file."""
    path = path / CARD if path.is_dir() else path
    wanted = f"a {CARD} that `poise scorecard` wrote, or its folder"
    try:
        data: Any = json.loads(read_text(path, error=ConfigurationError))
    except ValueError as error:
        raise ConfigurationError(
            f"not a scorecard ({error})", got=str(path), wanted=wanted
        ) from None
    if not isinstance(data, dict) or not {"trials", "left_out"} <= set(data):
        raise ConfigurationError("not a scorecard", got=str(path), wanted=wanted)
    return read(Card, data, path.name, error=ConfigurationError)


@dataclass(frozen=True, kw_only=True)
class Difference:
    """A case of two cards."""

    trial: TrialResult  # of either card
    first: CaseResult | None  # None where a card has no result
    second: CaseResult | None

    @property
    def either(self) -> CaseResult:
        """The case, of the first where both have it."""
        return cast("CaseResult", self.first or self.second)

    @property
    def verdict(self) -> Literal["better", "worse", "alike", ""]:
        """Order of the second to the first; alike where the intervals meet."""
        if self.first is None or self.second is None:
            return ""
        if self.first.low <= self.second.high and self.second.low <= self.first.high:
            return "alike"
        return "better" if self.second.level > self.first.level else "worse"


_NONE = (None, None)  # trial and case that a card lacks


def compare(first: Card, second: Card) -> list[Difference]:
    """Two cards case by case."""
    for name, what in (
        ("robot", "robots"),
        ("trials_version", "versions of the trials"),
        ("quick", "extents, one of them quick"),
    ):
        ours, theirs = getattr(first, name), getattr(second, name)
        if ours != theirs:
            raise ConfigurationError(
                f"the cards are of different {what}", got=theirs, wanted=f"{ours!r} as in the first"
            )
    own, others = (
        {(t.name, c.angle, c.phase): (t, c) for t in card.trials for c in t.cases}
        for card in (first, second)
    )
    return [
        Difference(trial=trial, first=own.get(key, _NONE)[1], second=others.get(key, _NONE)[1])
        for key, (trial, _) in {**own, **others}.items()
    ]
