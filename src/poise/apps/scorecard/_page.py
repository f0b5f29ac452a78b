"""The page of a scorecard, alone or beside another one."""

import math
import os
from collections.abc import Sequence
from html import escape
from pathlib import Path

from poise.apps.report import html_document
from poise.apps.scorecard._card import PAGE, Card, CaseResult, Difference, TrialResult, compare
from poise.apps.scorecard._charts import COLOURS, Bar, Spoke, bars, polar
from poise.apps.scorecard._trials import TRIALS

_STYLE = (
    "<style>.polars{display:flex;flex-wrap:wrap;gap:1rem 2rem}.polars figure{width:300px;margin:0}"
    ".polars svg{width:100%;height:auto;display:block}.polars figcaption{text-align:center}"
    "#table th,#table td{white-space:nowrap;vertical-align:top}#table td{padding-bottom:0}"
    "#table tr.why td{white-space:normal;color:#52606d;padding:0 .5rem .6rem 1.5rem}"
    "#table tr.figures td{border-bottom:0}"
    ".key i{display:inline-block;width:.8em;height:.8em;border-radius:50%;margin:0 .4em 0 1em}"
    "</style>"
)

_COLUMNS = 6
"""Of the table of one card."""

VERDICTS = {"better": "second better", "worse": "second worse", "alike": "", "": ""}
"""How the second of two cards stands to the first, in words."""

_HOW = (
    "Each trial makes one thing harder, from an easy end that anybody should survive to a hard end "
    "that hardly anybody does; by bisection, seed by seed, the hardest amount that the robot "
    "survived was looked for. Survived means: no fall, no divergence, no tick without an answer, "
    "upright at the end, a walk ended, an obstacle crossed, and standing back at rest. "
    "Figures are medians over the "
    "seeds; in brackets is the interval between two order statistics that holds the median with "
    "the confidence given in the table. Of trials that count seeds the figure is a share, with "
    "Wilson's interval of 95%."
)


def write_page(card: Card, folder: Path, other: Card | None = None) -> Path:
    """Writes the page of a card, which needs no network and no other file.

    Args:
        card: the card.
        folder: where the page goes; made if it does not exist.
        other: a card that it is shown beside.

    Raises:
        ConfigurationError: the cards cannot be compared.
    """
    page = page_html(card, other)
    folder.mkdir(parents=True, exist_ok=True)
    draft = folder / f".{PAGE}.tmp"
    draft.write_text(page, encoding="utf-8", newline="\n")
    os.replace(draft, folder / PAGE)
    return folder / PAGE


def page_html(card: Card, other: Card | None = None) -> str:
    """The page as text."""
    cards = [card] if other is None else [card, other]
    if other is not None:
        compare(card, other)
    body = [
        _STYLE,
        _header(cards),
        '<main class="wide">',
        _worst(cards),
        _pushes(cards),
        _bars(cards),
        _table(cards),
        _left_out(cards),
        f'<section id="how"><h2>How to read this</h2><p>{escape(_HOW)}</p></section>',
        "</main>",
        '<footer class="wide">Made by Poise.</footer>',
    ]
    return html_document(f"Scorecard of {card.robot}, {card.controller}", body)


def amount_text(value: float, unit: str) -> str:
    """An amount with its unit."""
    return f"{value:.3g} {unit}".rstrip()


def result_text(case: CaseResult | None, unit: str) -> str:
    """A result in a line: median, interval, and what is known besides."""
    if case is None:
        return "not tried"
    words = {"": "", "at least": "≥ ", "none": "none; not even "}[case.limit]
    if case.limit == "none":
        return f"{words}{amount_text(case.median, unit)}"
    return f"{words}{amount_text(case.median, unit)} [{case.low:.3g}, {case.high:.3g}]"


def names_of(cards: Sequence[Card]) -> list[str]:
    """What tells cards of one robot apart, as shortly as it can be said."""
    if len({card.version for card in cards}) > 1:
        return [card.title for card in cards]
    return [card.how for card in cards]


def _header(cards: Sequence[Card]) -> str:
    card = cards[0]
    facts = [("robot", card.robot), ("trials", f"version {card.trials_version}")]
    facts.append(("extent", "quick: few seeds and looks" if card.quick else "full"))
    facts += [("card", c.title) for c in cards]
    listed = "".join(f"<div><dt>{k}</dt><dd>{escape(v)}</dd></div>" for k, v in facts)
    names = " and ".join(escape(name) for name in names_of(cards))
    return (
        '<header><div class="wide"><div class="title">'
        f"<h1>How much {escape(card.robot)} can take <span>with {names}</span></h1></div>"
        f'<dl class="facts">{listed}</dl></div></header>'
    )


def _worst(cards: Sequence[Card]) -> str:
    whose = [f"{name}: " if len(cards) > 1 else "" for name in names_of(cards)]
    items = [_worst_of(card, words) for card, words in zip(cards, whose, strict=True)]
    return f'<section class="notes" id="worst"><h2>Worst</h2><ul>{"".join(items)}</ul></section>'


def _worst_of(card: Card, whose: str) -> str:
    if card.worst is None:
        return f"<li>{escape(whose)}nothing was tried.</li>"
    trial, case = card.worst
    what = f"{trial.title} {case.label}".strip()
    how = f" What happened first: {escape(case.mechanism)}." if case.mechanism else ""
    return (
        f"<li>{escape(whose)}<strong>{escape(what)}</strong>: "
        f"{escape(result_text(case, trial.unit))}, {100 * case.level:.0f}% of the way from the "
        f"easy end to the hard one.{how}</li>"
    )


def _pushes(cards: Sequence[Card]) -> str:
    """A polar plot for each trial by direction and each phase."""
    figures: list[str] = []
    for trial in TRIALS:
        if trial.spread not in ("directions", "phases"):
            continue
        found = [_trial_of(card, trial.name) for card in cards]
        either = next((t for t in found if t is not None), None)
        if either is None:
            continue
        limit = _round_up(max(c.high for t in found if t is not None for c in t.cases))
        for phase in dict.fromkeys(case.phase for case in either.cases):
            series = [_spokes(t, phase) for t in found]
            words = trial.title + ("" if phase is None else f", phase {phase:g} of the step")
            figures.append(
                f"<figure>{polar(series, limit, trial.unit, words)}"
                f"<figcaption>{escape(words)}</figcaption></figure>"
            )
    if not figures:
        return ""
    return (
        '<section id="pushes"><h2>Pushes by direction</h2><p class="how">The change of velocity '
        "(impulse over mass) by a push of 0.1 s on the torso towards each side that was survived; "
        "the band is the interval. A walking robot is pushed in its second step, in which the "
        "right foot swings; a phase of 0 is the lift-off of that foot, 1 the next lift-off."
        f'</p>{_key(cards)}<div class="polars">{"".join(figures)}</div></section>'
    )


def _spokes(trial: TrialResult | None, phase: float | None) -> list[Spoke]:
    cases = () if trial is None else trial.cases
    return [
        Spoke(angle=c.angle or 0.0, value=c.median, low=c.low, high=c.high)
        for c in cases
        if c.phase == phase
    ]


def _bars(cards: Sequence[Card]) -> str:
    rows: list[Bar] = []
    for trial in TRIALS:
        if trial.spread in ("directions", "phases"):
            continue
        found = [_trial_of(card, trial.name) for card in cards]
        either = next((t for t in found if t is not None), None)
        for case in () if either is None else either.cases:
            same = [_same(t, case) for t in found]
            rows.append(
                Bar(
                    name=f"{trial.title} {case.label}".strip(),
                    levels=[None if c is None else c.level for c in same],
                    intervals=[(0.0, 0.0) if c is None else _levels(either, c) for c in same],
                    texts=[result_text(c, trial.unit) for c in same],
                    ends=f"{trial.easy:g} to {trial.hard:g}",
                )
            )
    if not rows:
        return ""
    chart = bars(rows, "How far each trial was survived")
    return (
        '<section id="bars"><h2>Everything else</h2><p class="how">Bars go from the easy end of '
        "each trial to what was survived; a full one is its hard end. Both ends stand behind, in "
        f"grey. Slopes go down towards the side that is named.</p>{_key(cards)}"
        f'<div class="scroll"><div class="plot still">{chart}</div></div></section>'
    )


def _levels(trial: TrialResult | None, case: CaseResult) -> tuple[float, float]:
    """Both ends of a case's interval on the way from the easy end to the hard one."""
    own = next((t for t in TRIALS if trial is not None and t.name == trial.name), None)
    if own is None:
        return 0.0, 0.0
    ends = sorted(_level(amount, own.easy, own.hard, own.log) for amount in (case.low, case.high))
    return ends[0], ends[1]


def _level(amount: float, easy: float, hard: float, log: bool) -> float:
    if log:
        amount, easy, hard = (math.log(value) for value in (amount, easy, hard))
    return min(1.0, max(0.0, (amount - easy) / (hard - easy)))


def _table(cards: Sequence[Card]) -> str:
    if len(cards) == 1:
        (card,) = cards
        rows = [
            _row("", trial, case, "", spread=_COLUMNS)
            for trial in card.trials
            for case in trial.cases
        ]
    else:
        rows = [row for difference in compare(*cards) for row in _pair(difference, names_of(cards))]
    heads = ["card"] if len(cards) > 1 else []
    heads += ["trial", "case", "survived", "confidence", "seeds", "easy to hard"]
    heads += ["verdict"] if len(cards) > 1 else []
    head = "".join(f"<th>{name}</th>" for name in heads)
    return (
        '<section id="table"><h2>All figures</h2><p class="how">Below each case stands what '
        "happened in the failed episode that was nearest to what was survived."
        '</p><div class="scroll"><table><thead><tr>'
        f"{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div></section>"
    )


def _pair(difference: Difference, names: Sequence[str]) -> list[str]:
    """A case of two cards, one below the other."""
    verdict = VERDICTS[difference.verdict]
    cases = (difference.first, difference.second)
    said = ("", verdict) if difference.second is not None else ("", "")
    return [
        _row(name, difference.trial, case, words, spread=_COLUMNS + 2)
        for name, case, words in zip(names, cases, said, strict=True)
        if case is not None
    ]


def _row(name: str, trial: TrialResult, case: CaseResult, verdict: str, *, spread: int) -> str:
    """The figures of a case, and below them how it came that it was not survived further."""
    seeds = ", ".join(f"{seed.amount:.3g}" for seed in case.seeds[:10])
    cells = [
        trial.title,
        case.label or "–",
        result_text(case, trial.unit),
        f"{100 * case.confidence:.0f}%",
        seeds + (", …" if len(case.seeds) > 10 else ""),
        f"{trial.easy:g} to {trial.hard:g}",
    ]
    if name:
        cells = [name, *cells, verdict]
    figures = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
    if case.episode is None:
        return f"<tr>{figures}</tr>"
    why = escape(f"{case.mechanism} (episode {case.episode})")
    return (
        f'<tr class="figures">{figures}</tr><tr class="why"><td colspan="{spread}">{why}</td></tr>'
    )


def _left_out(cards: Sequence[Card]) -> str:
    items = [
        f"<li><strong>{escape(', '.join(titles))}</strong>"
        + (f" ({escape(name)})" if len(cards) > 1 else "")
        + f": {escape(reason)}</li>"
        for card, name in zip(cards, names_of(cards), strict=True)
        for reason, titles in reasons_of(card).items()
    ]
    if not items:
        return ""
    return (
        '<section id="left-out"><h2>Left out</h2><p class="how">Trials that this robot or '
        f"controller cannot be put to.</p><ul>{''.join(items)}</ul></section>"
    )


def reasons_of(card: Card) -> dict[str, list[str]]:
    """Titles of the trials that were left out, by the reason."""
    titles = {trial.name: trial.title for trial in TRIALS}
    found: dict[str, list[str]] = {}
    for name, reason in card.left_out.items():
        found.setdefault(reason, []).append(titles.get(name, name))
    return found


def _key(cards: Sequence[Card]) -> str:
    if len(cards) < 2:
        return ""
    items = "".join(
        f'<i style="background:{colour}"></i>{escape(name)}'
        for name, colour in zip(names_of(cards), COLOURS, strict=False)
    )
    return f'<p class="key">{items}</p>'


def _trial_of(card: Card, name: str) -> TrialResult | None:
    return next((trial for trial in card.trials if trial.name == name), None)


def _same(trial: TrialResult | None, case: CaseResult) -> CaseResult | None:
    cases = () if trial is None else trial.cases
    return next((c for c in cases if (c.angle, c.phase) == (case.angle, case.phase)), None)


def _round_up(value: float) -> float:
    """The next number with a fine fourth, for rings."""
    step = next(s for s in (0.2, 0.4, 0.8, 1.6, 3.2, math.inf) if value <= s)
    return step if math.isfinite(step) else value
