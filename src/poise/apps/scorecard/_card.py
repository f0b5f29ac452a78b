"""`Card`: what a robot with its controller survives, as a file that cards are compared by."""

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from poise._schema import Bounds, Number, Text, Truth, checked, read
from poise._yaml import read_text
from poise.errors import ConfigurationError

CARD, PAGE = "scorecard.json", "scorecard.html"
"""File names in a card's folder."""

Limit = Literal["", "at least", "none"]
"""Of an amount: what was found, the hard end survived, or not even the easy end."""

_SIDES = {0.0: "ahead", 90.0: "left", 180.0: "back", 270.0: "right"}
"""Directions that have a name, anticlockwise from ahead [deg]."""

_Share = Annotated[float, Bounds(least=0.0, most=1.0)]
_Whole = Annotated[int, Bounds(least=0.0, whole=True, most=1e15)]


@checked()
@dataclass(frozen=True, kw_only=True)
class SeedResult:
    """What one seed survived.

    Attributes:
        amount: the hardest amount that was survived, the easy end where none was; of a trial that
            counts seeds, 1 or 0.
        limit: what is known besides.
    """

    amount: Number
    limit: Limit = ""


@checked()
@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """What was survived in one direction, at one phase.

    Attributes:
        angle: direction, anticlockwise from ahead [deg]; None without.
        phase: of the step, from lift-off (0) to the next (1); None without.
        median: of the seeds' amounts; of a trial that counts seeds their share.
        low: lower end of its interval, in the order of the numbers.
        high: upper end of it.
        confidence: of the interval.
        level: where the median is between the easy end (0) and the hard one (1).
        limit: of the median.
        seeds: each seed's result, by seed.
        episode: number of the failed episode nearest to what was survived; None without.
        mechanism: what happened in it.
    """

    angle: Number | None = None
    phase: _Share | None = None
    median: Number
    low: Number
    high: Number
    confidence: _Share
    level: _Share
    limit: Limit
    seeds: tuple[SeedResult, ...]
    episode: _Whole | None = None
    mechanism: str = ""

    @property
    def label(self) -> str:
        """What tells it from the other cases of its trial."""
        parts = [] if self.phase is None else [f"phase {self.phase:g}"]
        if self.angle is not None:
            parts.append(_SIDES.get(self.angle, f"{self.angle:g}°"))
        return ", ".join(parts)


@checked()
@dataclass(frozen=True, kw_only=True)
class TrialResult:
    """What was survived in a trial.

    Attributes:
        name: of the trial.
        title: what it is.
        unit: of amounts.
        easy: amount at the easy end.
        hard: amount at the hard end.
        cases: by direction and phase.
    """

    name: Text
    title: Text
    unit: str
    easy: Number
    hard: Number
    cases: tuple[CaseResult, ...]


@checked()
@dataclass(frozen=True, kw_only=True)
class Card:
    """A scorecard.

    Attributes:
        robot: the robot's name.
        controller: its controller.
        strategy: how that solves; None for its default.
        version: of Poise.
        trials_version: of the table of trials.
        quick: whether it was made with few seeds and looks.
        trials: in the table's order.
        left_out: trials that could not be made, and why, by name.
    """

    robot: Text
    controller: Text
    strategy: Text | None = None
    version: Text
    trials_version: _Whole
    quick: Truth
    trials: tuple[TrialResult, ...]
    left_out: dict[Text, str]

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
        """Writes the card's file into a folder, whole or not at all."""
        path = folder / CARD
        draft = path.with_name(f".{CARD}.tmp")
        draft.write_text(json.dumps(asdict(self), indent=1) + "\n", encoding="utf-8")
        os.replace(draft, path)
        return path


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
    """A case of two cards.

    Attributes:
        trial: the first card's trial.
        first: the first card's result; None where it has none.
        second: the second card's result; None where it has none.
    """

    trial: TrialResult
    first: CaseResult | None
    second: CaseResult | None

    @property
    def verdict(self) -> Literal["better", "worse", "alike", ""]:
        """How the second stands to the first; alike where the intervals meet."""
        if self.first is None or self.second is None:
            return ""
        if self.first.low <= self.second.high and self.second.low <= self.first.high:
            return "alike"
        return "better" if self.second.level > self.first.level else "worse"


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
    differences: list[Difference] = []
    names = list(dict.fromkeys(t.name for card in (first, second) for t in card.trials))
    for name in names:
        trials = [_named(card, name) for card in (first, second)]
        either = trials[0] or trials[1]
        if either is None:
            continue
        for case in either.cases:
            same = [_like(trial, case) for trial in trials]
            differences.append(Difference(trial=either, first=same[0], second=same[1]))
    return differences


def _named(card: Card, name: str) -> TrialResult | None:
    return next((trial for trial in card.trials if trial.name == name), None)


def _like(trial: TrialResult | None, case: CaseResult) -> CaseResult | None:
    """The case of another card's trial with the same direction and phase."""
    found = () if trial is None else trial.cases
    key = (case.angle, case.phase)
    return next((other for other in found if (other.angle, other.phase) == key), None)
