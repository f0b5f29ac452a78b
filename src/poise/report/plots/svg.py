"""A matplotlib figure as SVG that can stand inside the page."""

import io
import re
from html import escape
from typing import Any

from poise.report.plots.style import FONT

_PAGE_FONT = "var(--font)"
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
    text = text.replace("xlink:href", "href").replace(f"'{FONT}'", _PAGE_FONT)
    return _own_ids(text, name)


def _shorten(match: re.Match[str]) -> str:
    # A hundredth of a point is far below a pixel on any screen.
    return f"{float(match.group()):.2f}".rstrip("0").rstrip(".")


def _own_ids(text: str, name: str) -> str:
    """Keep the ids that something refers to, under a prefix, and drop the others."""
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', text))

    def rename(match: re.Match[str]) -> str:
        return f' id="{name}-{match.group(1)}"' if match.group(1) in used else ""

    text = _ID.sub(rename, text)
    return re.sub(r'(url\(#|href="#)', rf"\g<1>{name}-", text)
