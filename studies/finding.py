"""`Finding`: one number of a paper beside ours, and whether the paper's claim holds.

`Section` and `Table`: what one part of a study has to show.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Any

from benchmarks.drawing import number
from poise.errors import ConfigurationError
from studies.figure import Figure, Film

_IN_FULL = 1e9
"""A number from 1,000 up to here is written out, with separators; beyond, as a power of ten."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One number beside what a paper says of it.

    Attributes:
        name: what was found, unique within its study.
        paper: the paper's number, in `unit`; None where the paper has none.
        ours: our number, in `unit`; None where it could not be computed.
        unit: unit of both; empty for a pure number.
        ok: whether what the paper claims (a value, a ratio, an order, a bound) holds. It never
            compares with an earlier run of ours.
        note: which claim that is, and where the numbers differ, why.
    """

    name: str
    paper: int | float | None
    ours: int | float | None
    unit: str
    ok: bool
    note: str = ""

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise ConfigurationError("a finding has no name", got=self.name, wanted="some words")
        if self.ok and (self.ours is None or not isfinite(self.ours)):
            raise ConfigurationError(
                f"the finding {self.name!r} holds without a number", got=self.ours, wanted="one"
            )

    def to_json(self) -> dict[str, Any]:
        """The finding as `study.json` holds it; a number that is not finite becomes null."""
        return {
            "name": self.name,
            "paper": _finite(self.paper),
            "ours": _finite(self.ours),
            "unit": self.unit,
            "ok": bool(self.ok),
            "note": self.note,
        }


def number_text(value: int | float | None) -> str:
    """A number for readers: whole numbers exactly, others with three or four figures.

    Args:
        value: the number; None gives a dash.
    """
    if value is None:
        return "–"
    if isinstance(value, int) or 1e3 <= abs(value) < _IN_FULL:
        return f"{value:,.0f}".replace("-", "−")
    return number(value)


def with_unit(value: int | float | None, unit: str) -> str:
    """A number with its unit behind it, where it has one."""
    text = number_text(value)
    return text if value is None or not unit else f"{text} {unit}"


def _finite(value: int | float | None) -> int | float | None:
    return None if value is None or not isfinite(value) else value


Cell = str | int | float | None
"""What stands in a table: words, or a number, which is written as in findings."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows under a header.

    Attributes:
        title: its heading.
        header: a name for each column, with the unit in brackets.
        rows: cells in the order of the header.
        caption: what the reader should see in it.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.header):
                raise ConfigurationError(
                    f"a row of the table {self.title!r} does not fit its header",
                    got=row,
                    wanted=f"{len(self.header)} cells",
                )


@dataclass(frozen=True, kw_only=True)
class Section:
    """What one part of a study found.

    Attributes:
        prose: paragraphs of plain text; words between backticks are set as code.
        findings: numbers beside the paper's.
        figures: drawings.
        tables: numbers that are no findings.
        films: videos, which lie beside the page.
        name: id of the part, given by the plan.
        title: heading, given by the plan.
    """

    prose: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    figures: tuple[Figure, ...] = ()
    tables: tuple[Table, ...] = ()
    films: tuple[Film, ...] = ()
    name: str = ""
    title: str = ""
