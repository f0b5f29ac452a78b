"""The page of a scorecard, alone or beside another one."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from poise.apps.pages import render_page, replace_file
from poise.apps.scorecard._card import PAGE, Card, CaseResult, Difference, TrialResult, compare
from poise.apps.scorecard._trials import TRIALS, Trial

VERDICTS = {"better": "second better", "worse": "second worse", "alike": "", "": ""}
"""Compare the second of two cards with the first, in words."""


def write_page(card: Card, folder: Path, other: Card | None = None) -> Path:
    """Write the page of a card, which needs no network and no other file.

    Args:
        card: the card.
        folder: where the page goes; made if it does not exist.
        other: a card that it is shown beside.

    Raises:
        ConfigurationError: the cards cannot be compared.
    """
    return replace_file(folder / PAGE, page_html(card, other))


def page_html(card: Card, other: Card | None = None) -> str:
    """Return the page as text."""
    cards = [card] if other is None else [card, other]
    found = compare(card, other or card)
    names = _names(cards)
    whose = [f"{name}: " if other is not None else "" for name in names]
    return render_page(
        "scorecard.html.j2",
        card=card,
        names=names,
        verdict=None,
        facts=[
            ("robot", card.robot),
            ("trials", f"version {card.trials_version}"),
            ("extent", "quick: few seeds and looks" if card.quick else "full"),
            *(("card", c.title) for c in cards),
        ],
        worst=[(name, *_worst(c)) for name, c in zip(whose, cards, strict=True)],
        polars=list(_polars(found, len(cards))),
        bars=list(_bars(found, len(cards))),
        rows=list(_rows(found, names)),
        left_out=[
            (", ".join(titles), name if other is not None else "", reason)
            for c, name in zip(cards, names, strict=True)
            for reason, titles in reasons_of(c).items()
        ],
    )


def result_text(case: CaseResult | None, unit: str) -> str:
    """A result in a line: median, interval, and which end it is at."""
    if case is None:
        return "not tried"
    amount = f"{case.median:.3g} {unit}".rstrip()
    if case.limit == "none":
        return f"none; not even {amount}"
    at_least = "≥ " if case.limit else ""
    return f"{at_least}{amount} [{case.low:.3g}, {case.high:.3g}]"


def reasons_of(card: Card) -> dict[str, list[str]]:
    """Titles of the trials that were left out, by the reason."""
    titles = {trial.name: trial.title for trial in TRIALS}
    found: dict[str, list[str]] = {}
    for name, reason in card.left_out.items():
        found.setdefault(reason, []).append(titles.get(name, name))
    return found


def _names(cards: Sequence[Card]) -> list[str]:
    """Shortest names that distinguish cards of one robot."""
    versions = {card.version for card in cards}
    return [card.title if len(versions) > 1 else card.how for card in cards]


def _worst(card: Card) -> tuple[str, str, str]:
    """Worst case of a card, the amount survived, and the first failure."""
    if card.worst is None:
        return "", "nothing was tried.", ""
    trial, case = card.worst
    share = f"{100 * case.level:.0f}% of the way from the easy end to the hard one."
    happened = f" What happened first: {case.mechanism}." if case.mechanism else ""
    return (
        f"{trial.title} {case.label}".strip(),
        f"{result_text(case, trial.unit)}, {share}",
        happened,
    )


def _polars(found: Sequence[Difference], count: int) -> Iterator[dict[str, Any]]:
    """A polar plot for each trial by direction and each phase."""
    for trial in TRIALS:
        own = [d for d in found if d.trial.name == trial.name]
        if not own or not _polar(trial):
            continue
        limit = _round_up(max(case.high for d in own for case in (d.first, d.second) if case))
        for phase in dict.fromkeys(d.either.phase for d in own):
            here = [d for d in own if d.either.phase == phase]
            shown = [[d.first for d in here], [d.second for d in here]][:count]
            words = trial.title + ("" if phase is None else f", phase {phase:g} of the step")
            yield {
                "words": words,
                "rings": [f"{limit * share:g} {trial.unit}" for share in (0.25, 0.5, 0.75, 1.0)],
                "series": [_outline([case for case in cases if case], limit) for cases in shown],
            }


def _polar(trial: Trial) -> bool:
    return trial.spread in ("directions", "phases")


def _outline(cases: Sequence[CaseResult], limit: float) -> dict[str, Any]:
    """Paths of both ends of the intervals and of the medians, and a dot a direction."""
    around = sorted(cases, key=lambda case: case.angle or 0.0)

    def places(name: str) -> list[str]:
        # As the template has them, of radius 120 about (170, 170); ahead is up, left is left.
        turned = [(math.radians(c.angle or 0.0), getattr(c, name) / limit) for c in around]
        xs = [170.0 - 120.0 * share * math.sin(turn) for turn, share in turned]
        ys = [170.0 - 120.0 * share * math.cos(turn) for turn, share in turned]
        return [f"{x:.1f} {y:.1f}" for x, y in zip(xs, ys, strict=True)]

    return {
        "high": places("high"),
        "low": places("low"),
        "median": places("median"),
        "titles": [f"{c.angle or 0.0:g}°: {result_text(c, '')}" for c in around],
    }


def _bars(found: Sequence[Difference], count: int) -> Iterator[dict[str, Any]]:
    """A bar a case and card, from the easy end to the hard one."""
    for trial in TRIALS:
        for d in found:
            if d.trial.name == trial.name and not _polar(trial):
                yield {
                    "name": d.trial.named(d.either),
                    "marks": [_bar(trial, case) for case in (d.first, d.second)[:count]],
                    "ends": f"{trial.easy:g} to {trial.hard:g}",
                }


def _bar(trial: Trial, case: CaseResult | None) -> dict[str, Any]:
    text = result_text(case, trial.unit)
    if case is None:
        return {"level": None, "text": text}
    low, high = sorted(trial.level(amount) for amount in (case.low, case.high))
    return {"level": case.level, "low": low, "high": high, "text": text}


def _rows(found: Sequence[Difference], names: Sequence[str]) -> Iterator[tuple[list[str], str]]:
    """Cells of each case and card, and why it was not survived further."""
    for d in found:
        verdicts = ("", VERDICTS[d.verdict])
        for name, case, verdict in zip(names, (d.first, d.second), verdicts, strict=False):
            if case is not None:
                cells = _cells(d.trial, case)
                yield [name, *cells, verdict] if len(names) > 1 else cells, _why(case)


def _cells(trial: TrialResult, case: CaseResult) -> list[str]:
    seeds = ", ".join(f"{seed.amount:.3g}" for seed in case.seeds[:10])
    return [
        trial.title,
        case.label,
        result_text(case, trial.unit),
        f"{100 * case.confidence:.0f}%",
        seeds + (", …" if len(case.seeds) > 10 else ""),
        f"{trial.easy:g} to {trial.hard:g}",
    ]


def _why(case: CaseResult) -> str:
    return "" if case.episode is None else f"{case.mechanism} (episode {case.episode})"


def _round_up(value: float) -> float:
    """The next number with a fine fourth, for rings."""
    return next((step for step in (0.2, 0.4, 0.8, 1.6, 3.2) if value <= step), value)
