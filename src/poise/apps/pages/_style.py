"""Colours, fonts and numbers of all plots, and a matplotlib figure as SVG inside a page."""

import io
import re
from collections.abc import Generator
from contextlib import contextmanager
from html import escape
from math import isfinite, isnan, log10
from pathlib import Path
from typing import Any
from warnings import catch_warnings, filterwarnings

from poise.errors import import_extra

_LONG_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_PATH_DATA = re.compile(r' d="[^"]*"')
_ID = re.compile(r' id="([^"]+)"')


def inline_svg(figure: Any, name: str, label: str) -> str:
    """Write a figure as an SVG element with the page's font, short numbers and ids of its own.

    Args:
        figure: a `matplotlib.figure.Figure`.
        name: prefix of all ids, unique in the page.
        label: what the figure shows, for screen readers.

    Returns:
        The `<svg>` element.
    """
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(
        r'<svg[^>]*viewBox="([^"]*)"[^>]*>',
        rf'<svg viewBox="\1" role="img" aria-label="{escape(label)}">',
        text,
        count=1,
    )
    text = _PATH_DATA.sub(lambda m: _LONG_NUMBER.sub(_shorten, m.group().replace("\n", "")), text)
    text = text.replace("xlink:href", "href").replace(f"'{_FONT}'", "var(--font)")
    return _own_ids(text, name)


def _shorten(match: re.Match[str]) -> str:
    # A hundredth of a point is far below a pixel on any screen.
    return f"{float(match.group()):.2f}".rstrip("0").rstrip(".")


def _own_ids(text: str, name: str) -> str:
    """Prefix the ids that are referenced, and drop the others."""
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', text))

    def rename(match: re.Match[str]) -> str:
        return f' id="{name}-{match.group(1)}"' if match.group(1) in used else ""

    text = _ID.sub(rename, text)
    return re.sub(r'(url\(#|href="#)', rf"\g<1>{name}-", text)


COM, ZMP, SUPPORT = "C0", "C1", "C2"
GOOD, BAD = SUPPORT, ZMP
INK, MUTED, LINE = "#1F2933", "#616E7C", "#CBD2D9"
REFERENCE, EVENT = "#52606D", "#7B8794"

_FONT = "DejaVu Sans"
_SHEET = Path(__file__).with_name("templates") / "plots.mplstyle"


@contextmanager
def house_style() -> Generator[None]:
    """Draw in the style of all pages, whatever the user's own matplotlib settings are.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    style = import_extra("matplotlib.style", "sim", "a plot")
    with catch_warnings(), style.context(["default", _SHEET]):
        # The browser draws the text with its own fonts, so a glyph missing here is not missing.
        filterwarnings("ignore", message="Glyph .* missing from")
        yield


def line_style(index: int) -> dict[str, Any]:
    """Colour and dashes of the line with this number, for `Axes.plot`."""
    from matplotlib import rcParams

    cycle = [*rcParams["axes.prop_cycle"]]
    return cycle[index % len(cycle)]


def plain(text: str, limit: int = 26) -> str:
    """A user's text as a label: one line, printable, not too long, never hidden by matplotlib."""
    printable = "".join(c if c.isprintable() else " " for c in text)
    line = " ".join(printable.split())
    if len(line) > limit:
        line = line[: limit - 1] + "…"
    # matplotlib leaves out of the legend whatever starts with an underscore.
    return f" {line}" if line.startswith("_") else line


def number(value: float | int) -> str:
    """A number with three or four figures, and powers of ten only where needed."""
    if not isfinite(value):
        return "–" if isnan(value) else "∞" if value > 0 else "−∞"
    size = abs(value)
    if size and (size >= 1e5 or size < 1e-3):
        mantissa, exponent = f"{value:.2e}".split("e")
        text = f"{float(mantissa):g}e{int(exponent)}"
    else:
        text = f"{value:.0f}" if size >= 100 else f"{value:.3g}"
    return text.replace("-", "−")


def power_of_ten(value: float, _position: int = 0) -> str:
    """Label of a decade on a logarithmic axis."""
    return "10" + str(round(log10(value))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
