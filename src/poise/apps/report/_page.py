"""The page itself: head, verdict, cards, checks, replay, plots and tables, put together as HTML.

The frame of every page that Poise writes: one HTML document with its style inside.
The summary's figures as cards at the head of the page.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import PurePosixPath
from typing import cast
from urllib.parse import quote

from poise.apps.report._plots import PlotFigure, number
from poise.apps.report._record import RunView
from poise.apps.report._replay_payload import replay_json
from poise.apps.report._tables import checks_html, events_html, tasks_html, ticks_html, verdict


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
    """The text of a file that goes into pages."""
    return files("poise.apps.report").joinpath("assets", name).read_text(encoding="utf-8")


@dataclass(frozen=True, kw_only=True)
class _Card:
    name: str
    figure: str
    unit: str = ""
    more: str = ""
    bad: bool = False


def cards_html(record: RunView) -> str:
    """A card for each figure of the summary that is there."""
    made = (
        _com(record),
        _torque(record),
        _step(record),
        _residual(record),
        _missed(record),
        _tick(record),
    )
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


def _com(record: RunView) -> _Card | None:
    value = _float(record.summary.get("com_error_max_m"))
    if value is None:
        return None
    return _Card(name="largest COM error", figure=number(1000.0 * value), unit="mm")


def _torque(record: RunView) -> _Card | None:
    value = _float(record.summary.get("torque_ratio_max"))
    if value is None:
        return None
    # A torque at its limit is legal: the controller keeps it there. Beyond it is not.
    over = value > 1.0 + 1e-6
    return _Card(
        name="highest torque", figure=number(100.0 * value), unit="% of its limit", bad=over
    )


def _step(record: RunView) -> _Card | None:
    value = _float(record.summary.get("torque_step_max"))
    if value is None:
        return None
    return _Card(
        name="largest torque step", figure=number(100.0 * value), unit="% of limit, a tick"
    )


def _residual(record: RunView) -> _Card | None:
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


def _missed(record: RunView) -> _Card | None:
    value = _float(record.summary.get("missed_ticks"))
    if value is None:
        return None
    return _Card(
        name="missed ticks",
        figure=f"{value:.0f}",
        unit=f"of {len(record.time)}",
        bad=value > 0,
    )


def _tick(record: RunView) -> _Card | None:
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


def _speed(record: RunView) -> _Card | None:
    value = _float(record.summary.get("real_time_factor"))
    if value is None:
        return None
    return _Card(name="speed of the run", figure=number(value), unit="× real time")


def _float(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value)


_SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "4")
_TOGGLES = (
    ("follow", "follow the robot"),
    ("com", "COM, ZMP, targets"),
    ("support", "support polygon"),
    ("forces", "forces"),
)
_VIEWS = ("corner", "front", "side", "top")


def page_html(record: RunView, figures: list[PlotFigure]) -> str:
    """The whole page as text."""
    title = f"{record.scenario} on {record.robot}"
    body = [
        _header(record),
        _nav(record, figures),
        '<main class="wide">',
        cards_html(record),
        _notes(record),
        checks_html(record),
        _replay() if record.replay else "",
        _video(record),
        *(_figure(f) for f in figures),
        tasks_html(record),
        ticks_html(record),
        events_html(record),
        _summary(record),
        "</main>",
        '<footer class="wide">Made by Poise. The 3D replay uses three.js (MIT licence, '
        "© three.js authors).</footer>",
        _scripts(record),
    ]
    return html_document(title, body)


def _header(record: RunView) -> str:
    words, good = verdict(record)
    duration = float(record.time[-1] - record.time[0])
    facts = (
        ("robot", record.robot),
        ("controller", record.controller),
        ("scenario", record.scenario),
        ("seed", str(record.seed)),
        ("duration", f"{number(duration)} s"),
    )
    listed = "".join(f"<div><dt>{k}</dt><dd>{escape(v)}</dd></div>" for k, v in facts)
    description = escape(record.description)
    return (
        '<header><div class="wide"><div class="title">'
        f"<h1>{escape(record.scenario)} <span>on {escape(record.robot)}</span></h1>"
        f'<div class="verdict {"good" if good else "bad"}">{escape(words)}</div></div>'
        f'<dl class="facts">{listed}</dl>'
        + (f'<p class="description">{description}</p>' if description else "")
        + "</div></header>"
    )


def _nav(record: RunView, figures: list[PlotFigure]) -> str:
    links = [("checks", "Checks")] if record.checks else []
    if record.replay:
        links.append(("replay", "3D replay"))
    if record.video:
        links.append(("video", "Video"))
    links += [(f.name, f.short_title) for f in figures if not f.folded]
    links.append(("summary", "Summary"))
    items = "".join(f'<a href="#{name}">{escape(text)}</a>' for name, text in links)
    return f'<nav><div class="wide">{items}</div></nav>'


def _notes(record: RunView) -> str:
    notes = list(record.notes)
    if record.ended_early:
        notes.insert(0, f"The run stopped before its end: {record.ended_early}")
    if not notes:
        return ""
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return f'<section class="notes"><ul>{items}</ul></section>'


def _replay() -> str:
    speeds = "".join(
        f'<option value="{s}"{" selected" if s == "1" else ""}>{s}×</option>' for s in _SPEEDS
    )
    toggles = "".join(
        f'<label><input type="checkbox" value="{value}" checked>{text}</label>'
        for value, text in _TOGGLES
    )
    views = "".join(f'<button type="button" value="{v}">{v}</button>' for v in _VIEWS)
    return f"""<section id="replay">
<h2>3D replay</h2>
<p class="how">Drag to turn, scroll to come nearer, drag with the right button to shift; a click
into any plot over time shows that moment here, and the line in the plots follows the replay.</p>
<div class="stage"><canvas data-part="canvas" aria-label="3D replay of the robot"></canvas>
<p class="sorry" data-part="sorry" hidden>This browser offers no WebGL, so the 3D replay cannot be
drawn here. Everything else on the page works; another browser, or this one with hardware
acceleration turned on, will show it.</p>
<ul class="legend" data-part="legend"></ul><div class="now" data-part="now"></div></div>
<div class="controls"><button type="button" class="main" data-part="play">Play</button>
<span class="track" data-part="track"><input type="range" data-part="slider" value="0"
aria-label="time"></span><output data-part="time"></output>
<label>speed <select data-part="speed">{speeds}</select></label></div>
<div class="controls" data-part="views">{toggles}<span class="group">view {views}</span></div>
</section>"""


def _video(record: RunView) -> str:
    if not record.video:
        return ""
    source = escape(quote(record.video))
    poster = escape(quote(str(PurePosixPath(record.video).with_suffix(".jpg"))))
    return (
        '<section id="video"><h2>Video</h2><p class="how">The same run as the simulator draws it; '
        "the file lies beside this page.</p>"
        '<video controls loop muted playsinline preload="metadata" '
        f'poster="{poster}" src="{source}"></video>'
        "</section>"
    )


def _figure(figure: PlotFigure) -> str:
    axes = f" data-axes='{json.dumps(figure.time_axes)}'" if figure.time_axes else ""
    kind = "plot" if figure.time_axes else "plot still"
    heading = escape(figure.title)
    inside = (
        f'<p class="how">{escape(figure.how_to_read)}</p>'
        f'<div class="scroll"><div class="{kind}"{axes}>{figure.svg}</div></div>'
    )
    if figure.folded:
        inside = f"<details><summary>{heading}</summary>{inside}</details>"
    else:
        inside = f"<h2>{heading}</h2>{inside}"
    return f'<section id="{figure.name}" data-figure="{figure.name}">{inside}</section>'


def _summary(record: RunView) -> str:
    text = json.dumps(record.summary, indent=2, default=str, ensure_ascii=False)
    return (
        '<section id="summary"><details><summary>Summary as data (summary.json)</summary>'
        f"<pre>{escape(text)}</pre></details></section>"
    )


def _scripts(record: RunView) -> str:
    scripts = [f"<script>\n{asset('page.js')}</script>"]
    if record.replay:
        payload = replay_json(record, record.replay)
        scripts += [
            f'<script type="application/json" id="replay-data">{payload}</script>',
            f"<script>{asset('three.bundle.min.js')}</script>",
            f"<script>\n{asset('scene.js')}</script>",
            f"<script>\n{asset('replay.js')}</script>",
        ]
    return "\n".join(scripts)
