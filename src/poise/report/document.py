"""The frame of every page that Poise writes: one HTML document with its style inside."""

from collections.abc import Iterable
from html import escape
from importlib.resources import files


def html_document(title: str, body: Iterable[str]) -> str:
    """A whole page that refers to nothing outside itself.

    Args:
        title: what the browser's tab says, as plain text.
        body: pieces of HTML, in order; empty ones are left out.

    Returns:
        The document as text.
    """
    return "\n".join(
        [
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)} – Poise</title>",
            # An icon of nothing: without it a browser asks the server for one.
            '<link rel="icon" href="data:,">',
            f"<style>\n{asset('page.css')}</style>\n</head>\n<body>",
            *(part for part in body if part),
            "</body>\n</html>\n",
        ]
    )


def asset(name: str) -> str:
    """The text of a file that goes into pages.

    Args:
        name: its name in `assets`.
    """
    return files("poise.report").joinpath("assets", name).read_text(encoding="utf-8")
