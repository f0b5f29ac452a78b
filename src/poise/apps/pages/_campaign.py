"""`write_campaign_page`: outcomes, falls by parameter and quantiles of a campaign's figures."""

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from poise.apps.pages._render import render_page, replace_file
from poise.apps.pages._style import number

_RAN = ("ok", "failed", "fell", "diverged")
"""Outcomes of episodes that ran, whose falls mean something."""


def write_campaign_page(table: Sequence[Mapping[str, Any]], path: Path) -> Path:
    """Write a page about a campaign's rows.

    Args:
        table: a row an episode, as `run_campaign` returns them.
        path: the file; its folder is the campaign's.

    Returns:
        The path.
    """
    counts = Counter(row["outcome"] for row in table)
    ran = [row for row in table if row["outcome"] in _RAN]
    wrong = [row for row in table if row["outcome"] != "ok"]
    page = render_page(
        "campaign.html.j2",
        name=path.parent.name or "campaign",
        folder=str(path.parent),
        facts=[("episodes", len(table)), *_facts(table)],
        verdict=None,
        cards=[
            {"name": outcome, "figure": count, "unit": f"of {len(table)}", "bad": outcome == "fell"}
            for outcome, count in counts.most_common()
        ],
        bars=[bar for name in _parameters(ran) for bar in _falls(name, ran)],
        quantiles=list(_quantiles(ran)),
        wrong=[(r["number"], r["outcome"], _in_words(r), r.get("reason")) for r in wrong],
        listed=25,
    )
    return replace_file(path, page)


def _facts(table: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    for column in ("robot", "controller", "version"):
        found = dict.fromkeys(str(row[column]) for row in table if row.get(column) is not None)
        if found:
            yield column, ", ".join(found)


def _values(row: Mapping[str, Any]) -> dict[str, Any]:
    """Values of the varied fields by path, behind the case where there are some."""
    case = {"case": row["case"]} if row.get("case") else {}
    return {**case, **json.loads(row.get("values") or "{}")}


def _in_words(row: Mapping[str, Any]) -> str:
    return ", ".join(f"{path} {_text(value)}" for path, value in _values(row).items())


def _text(value: Any) -> str:
    """A value of a field for readers."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return number(value)
    return value if isinstance(value, str) else json.dumps(value)


def _parameters(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Paths of fields with two values or more."""
    found: dict[str, set[str]] = {}
    for row in rows:
        for path, value in _values(row).items():
            found.setdefault(path, set()).add(json.dumps(value))
    return [path for path, values in found.items() if len(values) > 1]


def _falls(path: str, rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Share of falls by the values of a field, with Wilson's interval of 95%."""
    from scipy.stats import binomtest

    pairs = [(_values(row).get(path), row["outcome"] == "fell") for row in rows]
    groups = _groups([value for value, _ in pairs])
    bars: list[dict[str, Any]] = []
    for name in dict.fromkeys(sorted(groups)):
        fell = [f for group, (_, f) in zip(groups, pairs, strict=True) if group == name]
        ends = binomtest(sum(fell), len(fell)).proportion_ci(method="wilson")
        share = sum(fell) / len(fell)
        text = f"{share:.0%} [{ends.low:.0%}, {ends.high:.0%}]"
        mark = {"level": share, "low": float(ends.low), "high": float(ends.high), "text": text}
        label = f"{path} {name[1]}"
        bars.append({"name": label, "marks": [mark], "ends": f"{sum(fell)} of {len(fell)}"})
    return bars


def _groups(values: Sequence[Any], most: int = 8) -> list[tuple[float, str]]:
    """Place and name of the group of each value: its own, unless there are more than so many."""
    distinct = {json.dumps(value) for value in values}
    numeric = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    if numeric and len(distinct) > most:
        edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, 5)))
        places = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
        names = [f"{number(float(a))} to {number(float(b))}" for a, b in pairwise(edges)]
        return [(float(place), names[place]) for place in places]
    if numeric:
        return [(float(value), number(value)) for value in values]
    names = [_text(value) for value in values]
    common = {name for name, _ in Counter(names).most_common(most)}
    return [(0.0, name if name in common else "any other") for name in names]


def _quantiles(rows: Sequence[Mapping[str, Any]]) -> Iterator[tuple[Any, ...]]:
    """Name, count and quantiles of each column of numbers that is a result."""
    given = {"number", "seed", "trial", *(path for row in rows for path in _values(row))}
    for name in dict.fromkeys(column for row in rows for column in row):
        found = [row.get(name) for row in rows]
        numbers = [v for v in found if isinstance(v, int | float) and not isinstance(v, bool)]
        finite = [value for value in numbers if np.isfinite(value)]
        if finite and name not in given:
            yield (
                name,
                len(finite),
                *(float(q) for q in np.quantile(finite, (0.05, 0.25, 0.5, 0.75, 0.95))),
            )
