"""`Section`: what one part of a study has to show.

`Finding`: one number of a paper beside ours, and whether the paper's claim holds. `Table`.
`Figure` and `draw`: a drawing in the report's style.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, isnan
from typing import Any

from poise.apps.pages import house_style, inline_svg
from poise.errors import ConfigurationError, MissingExtraError

WIDTH = 12.0
"""Width of every figure [in]: 1152 px, so that a 9 pt label is 12 px high on the page."""

_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")
_FONTS = "system-ui, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, 'DejaVu Sans', sans-serif"
_VIEW_BOX = re.compile(r'viewBox="0 0 ([\d.]+) ([\d.]+)"')


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A finished drawing."""

    name: str  # id in the page and name of the file, unique within the study: `figure-1`
    title: str  # its heading
    caption: str  # what it shows and how to read it
    svg: str  # the drawing as an element of the page

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise ConfigurationError(
                "a figure's name is no file name",
                got=self.name,
                wanted="lower-case letters, digits and hyphens",
            )

    def to_file(self) -> str:
        """The drawing as a file that stands alone, on white, with fonts that every machine has."""
        size = _VIEW_BOX.search(self.svg)
        width, height = size.groups() if size else ("100%", "100%")
        head = (
            '<svg xmlns="http://www.w3.org/2000/svg" '
            f'width="{width}pt" height="{height}pt" style="background:#fff"'
        )
        return self.svg.replace("<svg", head, 1).replace("var(--font)", _FONTS) + "\n"


def draw(
    name: str, title: str, caption: str, height: float, paint: Callable[[Any], None]
) -> Figure:
    """Draws in the report's style, as wide as the page.

    Args:
        name: id in the page and name of the file.
        title: its heading.
        caption: what it shows and how to read it.
        height: height of the drawing [in]; it is `WIDTH` = 12 in wide.
        paint: draws on the `matplotlib.figure.Figure` that it gets; the layout is constrained.

    Returns:
        The figure.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    require_matplotlib()
    with house_style():
        from matplotlib.figure import Figure as Canvas

        canvas = Canvas(figsize=(WIDTH, height), layout="constrained")
        paint(canvas)
        return Figure(name=name, title=title, caption=caption, svg=inline_svg(canvas, name, title))


def one_legend(canvas: Any, panel: Any) -> None:
    """The legend of one panel for the whole drawing."""
    handles, labels = panel.get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside upper left", ncols=len(labels))


def require_matplotlib() -> None:
    """Says early that the figures cannot be drawn."""
    try:
        import matplotlib  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError:
        raise MissingExtraError("matplotlib", "sim", "a study's figures") from None


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One number beside what a paper says of it, or a bound."""

    name: str  # what was found, unique within its study
    ours: int | float | None  # our number, in `unit`; None where it could not be computed
    # True where what the paper claims (a value, a ratio, an order, a bound) holds, or a bound of
    # ours where it says nothing. It never compares with an earlier run of ours.
    ok: bool
    # The paper's number, in `unit`; where it has none our bound, and None where there is neither
    paper: int | float | None = None
    unit: str = ""  # unit of both; empty for a pure number
    note: str = ""  # which claim that is, and where the numbers differ, why

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
    """A number for readers: whole numbers and large ones to the last digit, others to the third."""
    if value is None or isnan(value):
        return "–"
    whole = isinstance(value, int) or 1e3 <= abs(value) < 1e9
    return (f"{value:,.0f}" if whole else f"{value:.3g}").replace("-", "−")


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
    """Rows under a header."""

    title: str  # its heading
    header: str  # names of the columns with their units in brackets, a ` | ` between them
    rows: tuple[tuple[Cell, ...], ...]  # cells in the order of the header
    caption: str = ""  # what the reader should see in it

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ConfigurationError(
                    f"a row of the table {self.title!r} does not fit its header",
                    got=row,
                    wanted=f"{len(self.columns)} cells",
                )

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return self.header.split(" | ")


@dataclass(frozen=True, kw_only=True)
class Section:
    """Findings of one part of a study."""

    prose: tuple[str, ...] = ()  # paragraphs of plain text; words between backticks are set as code
    findings: tuple[Finding, ...] = ()  # numbers beside the paper's
    figures: tuple[Figure, ...] = ()  # drawings
    tables: tuple[Table, ...] = ()  # numbers that are no findings
    name: str = ""  # id of the part, given by the plan
    title: str = ""  # heading, given by the plan
