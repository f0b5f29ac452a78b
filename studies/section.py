"""`Section` and `Table`: what one part of a study has to show."""

from dataclasses import dataclass

from poise.errors import ConfigurationError
from studies.figure import Figure
from studies.film import Film
from studies.finding import Finding

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
