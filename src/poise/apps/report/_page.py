"""`write_report`: from the record of a run to `report.html`, a page with plots and a 3D replay."""

import json
from collections.abc import Iterable, Iterator
from importlib.resources import files
from pathlib import Path, PurePosixPath
from typing import Any

from poise.apps.pages import house_style, number, render_page, replace_file
from poise.apps.report._plots import PlotFigure, draw_plots, greatest, tick_percentiles
from poise.apps.report._record import RunSignals
from poise.apps.report._replay import replay_json


def write_report(run: RunSignals, directory: Path) -> Path:
    """Write one self-contained page about a run; it needs no network and no server.

    The same record gives the same bytes.
    """
    with house_style():
        figures = draw_plots(run)
    return replace_file(directory / "report.html", page_html(run, figures))


def page_html(run: RunSignals, figures: Iterable[PlotFigure]) -> str:
    """Return the whole page as text."""
    early = [f"The run stopped before its end: {run.ended_early}"] if run.ended_early else []
    scripts = ("page.js", "three.bundle.min.js", "scene.js", "replay.js")
    return render_page(
        "report.html.j2",
        run=run,
        figures=figures,
        facts=(
            ("robot", run.robot),
            ("controller", run.controller),
            ("scenario", run.scenario),
            ("seed", run.seed),
            ("duration", f"{number(float(run.time[-1] - run.time[0]))} s"),
        ),
        verdict=_verdict(run),
        cards=list(_cards(run)),
        notes=[*early, *run.notes],
        checks=sorted(run.checks, key=lambda check: check.ok),
        poster=str(PurePosixPath(run.video or "").with_suffix(".jpg")) if run.video else "",
        tasks=[(t.name, t.level + 1, number(greatest(t.error)), t.unit) for t in run.tasks],
        ticks=tick_percentiles(run),
        summary=json.dumps(run.summary, indent=2, default=str, ensure_ascii=False),
        replay=replay_json(run, run.replay) if run.replay else "",
        scripts=[asset(name) for name in (scripts if run.replay else scripts[:1])],
    )


def asset(name: str) -> str:
    """Read a script that pages use."""
    return files("poise.apps.report").joinpath("assets", name).read_text(encoding="utf-8")


def _verdict(run: RunSignals) -> tuple[str, bool]:
    """Outcome of the run in words; True for success."""
    failed, count = sum(not check.ok for check in run.checks), len(run.checks)
    if run.fell:
        return "✗ The robot fell", False
    if run.ended_early:
        return "✗ The run ended early", False
    if failed:
        return f"✗ {failed} of {count} {'checks' if count > 1 else 'check'} failed", False
    if count < 2:
        return ("✓ The check holds" if count else "✓ Ran to its end, nothing was checked"), True
    return f"✓ All {count} checks hold", True


def _cards(run: RunSignals) -> Iterator[dict[str, Any]]:
    """Figures of the summary at the head of the page, as far as they are there."""
    # A torque at its limit is legal: the controller keeps it there. Beyond it is not.
    plain = (
        ("com_error_max_m", "largest CoM error", 1e3, "mm", None),
        ("torque_ratio_max", "highest torque", 100.0, "% of its limit", 1.0 + 1e-6),
        ("torque_step_max", "largest torque step", 100.0, "% of limit, a tick", None),
        ("missed_ticks", "missed ticks", 1.0, f"of {len(run.time)}", 0.0),
        ("real_time_factor", "speed of the run", 1.0, "× real time", None),
    )
    summary: Any = run.summary
    card = {"unit": "", "bad": False}
    for key, name, scale, unit, most in plain:
        value = summary.get(key)
        if value is not None:
            bad = most is not None and value > most
            yield {"name": name, "figure": number(scale * value), "unit": unit, "bad": bad}
    levels = [number(v) for v in summary.get("residual_max", ()) if v is not None]
    if levels:
        more = " · ".join(f"{i}: {v}" for i, v in enumerate(levels[1:3], 2))
        more = f"level {more}" if more else ""
        yield {**card, "name": "residual, level 1", "figure": levels[0], "more": more}
    ticks = summary.get("tick_us", {})
    if ticks.get("p50") is not None:
        more = " · ".join(f"{name} {number(ticks[name])}" for name in ("p99", "max"))
        p50 = number(ticks["p50"])
        yield {**card, "name": "tick time, p50", "figure": p50, "unit": "µs", "more": more}
