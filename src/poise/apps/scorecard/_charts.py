"""Polar plots and bars of scorecards, as SVG that stands inside a page."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

COLOURS = ("#0072b2", "#d55e00")
"""Of the first and the second card: they differ for whoever cannot tell red from green."""

_RADIUS, _CENTRE, _SIZE = 120.0, 170.0, 340.0
_RINGS = 4
_WIDTH, _ROW, _LABEL, _BAR, _ENDS = 980.0, 24.0, 250.0, 380.0, 880.0
"""Of bars: width of the chart, height of a row, room for the name, length of a full bar, and where
its ends are told."""


@dataclass(frozen=True, kw_only=True)
class Spoke:
    """What was survived in one direction.

    Attributes:
        angle: anticlockwise from ahead, which is drawn upwards [deg].
        value: the amount.
        low: lower end of its interval.
        high: upper end of its interval.
    """

    angle: float
    value: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Bar:
    """What was survived in one case.

    Attributes:
        name: what the row says.
        levels: level of each card, from 0 to 1; None where a card has none.
        intervals: both ends of each level's interval.
        texts: what stands behind each bar.
        ends: amounts at the easy and the hard end, as text.
    """

    name: str
    levels: Sequence[float | None]
    intervals: Sequence[tuple[float, float]]
    texts: Sequence[str]
    ends: str


def polar(series: Sequence[Sequence[Spoke]], limit: float, unit: str, label: str) -> str:
    """Directions around a robot that looks up the page."""
    rings = [limit * (i + 1) / _RINGS for i in range(_RINGS)]
    parts = [_circle(ring / limit * _RADIUS, "#cbd2d9") for ring in rings]
    parts += [_line_out(30.0 * i) for i in range(12)]
    for words, angle in (("ahead", 0.0), ("left", 90.0), ("back", 180.0), ("right", 270.0)):
        x, y = _at(angle, _RADIUS + 22.0)
        parts.append(_text(x, y + 4.0, words, "middle"))
    for spokes, colour in zip(series, COLOURS, strict=False):
        parts += _outline(sorted(spokes, key=lambda s: s.angle), limit, colour)
    parts += [
        _text(*_at(-15.0, ring / limit * _RADIUS), f"{ring:g} {unit}", "start", small=True)
        for ring in rings
    ]
    return _svg(_SIZE, _SIZE, parts, label)


def bars(rows: Sequence[Bar], label: str) -> str:
    """A row a case, with a bar a card from the easy end on the left to the hard one."""
    parts: list[str] = []
    y = 6.0
    for row in rows:
        height = _ROW * max(1, len(row.levels))
        parts.append(_text(_LABEL - 10.0, y + height / 2 + 4.0, row.name, "end"))
        parts.append(_text(_ENDS, y + height / 2 + 4.0, row.ends, "start", small=True))
        parts.append(
            f'<rect x="{_LABEL}" y="{y + 3:.1f}" width="{_BAR}" height="{height - 6:.1f}" '
            'fill="#eef1f5"/>'
        )
        for i, (level, ends, words) in enumerate(
            zip(row.levels, row.intervals, row.texts, strict=True)
        ):
            parts += _bar(y + i * _ROW, level, ends, words, COLOURS[i])
        y += height + 4.0
    return _svg(_WIDTH, y + 2.0, parts, label)


def _bar(
    y: float, level: float | None, ends: tuple[float, float], words: str, colour: str
) -> list[str]:
    parts = [_text(_LABEL + _BAR + 10.0, y + _ROW / 2 + 4.0, words, "start")]
    if level is None:
        return parts
    middle = y + _ROW / 2
    low, high = (_LABEL + _BAR * end for end in ends)
    parts.append(
        f'<rect x="{_LABEL}" y="{y + 5:.1f}" width="{_BAR * level:.1f}" height="{_ROW - 10:.1f}" '
        f'fill="{colour}"/>'
    )
    parts.append(
        f'<path d="M{low:.1f} {middle:.1f}H{high:.1f}M{low:.1f} {middle - 4:.1f}v8'
        f'M{high:.1f} {middle - 4:.1f}v8" stroke="#1f2933" fill="none"/>'
    )
    return parts


def _outline(spokes: Sequence[Spoke], limit: float, colour: str) -> list[str]:
    """The band between the intervals' ends, the values' polygon and a dot a direction."""
    ends = [
        _path([_at(s.angle, getattr(s, name) / limit * _RADIUS) for s in spokes])
        for name in ("high", "low", "value")
    ]
    dots = [
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"><title>{s.angle:g}°: '
        f"{s.value:.3g} [{s.low:.3g}, {s.high:.3g}]</title></circle>"
        for s in spokes
        for x, y in (_at(s.angle, s.value / limit * _RADIUS),)
    ]
    return [
        f'<path d="{ends[0]}{ends[1]}" fill="{colour}" fill-opacity="0.18" fill-rule="evenodd"/>',
        f'<path d="{ends[2]}" fill="none" stroke="{colour}" stroke-width="2"/>',
        *dots,
    ]


def _at(angle: float, radius: float) -> tuple[float, float]:
    """Where a direction is on the page: ahead is up, left is left."""
    turn = math.radians(angle)
    return _CENTRE - radius * math.sin(turn), _CENTRE - radius * math.cos(turn)


def _path(points: Sequence[tuple[float, float]]) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) + "Z"


def _circle(radius: float, colour: str) -> str:
    return f'<circle cx="{_CENTRE}" cy="{_CENTRE}" r="{radius:.1f}" fill="none" stroke="{colour}"/>'


def _line_out(angle: float) -> str:
    x, y = _at(angle, _RADIUS)
    return f'<path d="M{_CENTRE} {_CENTRE}L{x:.1f} {y:.1f}" stroke="#e4e7eb"/>'


def _text(x: float, y: float, words: str, anchor: str, *, small: bool = False) -> str:
    size, colour = (11, "#52606d") if small else (13, "#1f2933")
    # The white seam keeps words apart from lines below them.
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}" '
        f'fill="{colour}" stroke="#fff" stroke-width="3" paint-order="stroke">'
        f"{escape(words)}</text>"
    )


def _svg(width: float, height: float, parts: Sequence[str], label: str) -> str:
    return (
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" role="img" aria-label="{escape(label)}" '
        f'font-family="var(--font)">{"".join(parts)}</svg>'
    )
