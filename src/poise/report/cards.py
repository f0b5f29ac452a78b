"""The summary's figures as cards at the head of the page."""

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from typing import cast

from poise.report.plots.style import number
from poise.report.record import RunRecord


@dataclass(frozen=True, kw_only=True)
class _Card:
    name: str
    figure: str
    unit: str = ""
    more: str = ""
    bad: bool = False


def cards_html(record: RunRecord) -> str:
    """A card for each figure of the summary that is there."""
    made = (_com(record), _torque(record), _residual(record), _missed(record), _tick(record))
    cards = [card for card in (*made, _speed(record)) if card is not None]
    if not cards:
        return ""
    return '<div class="cards">' + "".join(_html(card) for card in cards) + "</div>"


def _html(card: _Card) -> str:
    unit = f" <small>{escape(card.unit)}</small>" if card.unit else ""
    more = f'<div class="more">{escape(card.more)}</div>' if card.more else ""
    return (
        f'<div class="card{" bad" if card.bad else ""}"><div class="name">{escape(card.name)}</div>'
        f'<div class="figure">{escape(card.figure)}{unit}</div>{more}</div>'
    )


def _com(record: RunRecord) -> _Card | None:
    value = _float(record.summary.get("com_error_max_m"))
    if value is None:
        return None
    return _Card(name="largest COM error", figure=number(1000.0 * value), unit="mm")


def _torque(record: RunRecord) -> _Card | None:
    value = _float(record.summary.get("torque_ratio_max"))
    if value is None:
        return None
    # A torque at its limit is legal: the controller keeps it there. Beyond it is not.
    over = value > 1.0 + 1e-6
    return _Card(
        name="highest torque", figure=number(100.0 * value), unit="% of its limit", bad=over
    )


def _residual(record: RunRecord) -> _Card | None:
    value = record.summary.get("residual_max")
    listed = cast("list[object]", value) if isinstance(value, list | tuple) else []
    levels = [number(v) for v in map(_float, listed) if v is not None]
    if not levels:
        return None
    rest = " · ".join(f"{i}: {v}" for i, v in enumerate(levels[1:3], 2))
    return _Card(
        name="residual, level 1",
        figure=levels[0],
        more=f"level {rest}" if rest else "",
    )


def _missed(record: RunRecord) -> _Card | None:
    value = _float(record.summary.get("missed_ticks"))
    if value is None:
        return None
    return _Card(
        name="missed ticks",
        figure=f"{value:.0f}",
        unit=f"of {len(record.time)}",
        bad=value > 0,
    )


def _tick(record: RunRecord) -> _Card | None:
    value = record.summary.get("tick_us")
    if not isinstance(value, Mapping):
        return None
    ticks = {k: _float(v) for k, v in cast("Mapping[str, object]", value).items()}
    p50, p99, greatest = (ticks.get(k) for k in ("p50", "p99", "max"))
    if p50 is None:
        return None
    rest = (("p99", p99), ("max", greatest))
    more = " · ".join(f"{name} {number(v)}" for name, v in rest if v is not None)
    return _Card(name="tick time, p50", figure=number(p50), unit="µs", more=more)


def _speed(record: RunRecord) -> _Card | None:
    value = _float(record.summary.get("real_time_factor"))
    if value is None:
        return None
    return _Card(name="speed of the run", figure=number(value), unit="× real time")


def _float(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value)
