"""`Figure` and `draw`: a drawing in the report's style, for the page and as a file.

`Film`: a video of a study, which lies beside its page.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from poise.apps.report import house_style, inline_svg
from poise.errors import ConfigurationError, MissingExtraError

WIDTH = 12.0
"""Width of every figure [in]: 1152 px, so that a 9 pt label is 12 px high on the page."""

_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")
_FONTS = "system-ui, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, 'DejaVu Sans', sans-serif"
_VIEW_BOX = re.compile(r'viewBox="0 0 ([\d.]+) ([\d.]+)"')


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A finished drawing.

    Attributes:
        name: id in the page and name of the file, unique within the study: `figure-1`.
        title: its heading.
        caption: what it shows and how to read it.
        svg: the drawing as an element of the page.
    """

    name: str
    title: str
    caption: str
    svg: str

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
    *, name: str, title: str, caption: str, height: float, paint: Callable[[Any], None]
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


def require_matplotlib() -> None:
    """Says early that the figures cannot be drawn.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        import matplotlib  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError:
        raise MissingExtraError("matplotlib", "sim", "a study's figures") from None


@dataclass(frozen=True, kw_only=True)
class Film:
    """A video.

    Attributes:
        name: of its file, unique within the study.
        title: what it shows.
        data: the mp4 file's contents.
    """

    name: str
    title: str
    data: bytes = field(repr=False)

    @property
    def file_name(self) -> str:
        """Of the file beside the page."""
        return f"{self.name}.mp4"
