"""Beyond the paper: the formulation on a standing humanoid, beside the whole-body QP."""

from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from benchmarks.drawing import PALETTE, decimate
from poise.apps.scenarios import Run, load_scenario, run_scenario
from poise.control import ControllerPlan
from studies.finding import Figure, Finding, Section, Table, draw
from studies.plan import Progress, Steps, StudyOptions

_CONTROLLERS = ("osf", "whole_body")
_LOOKS = {"osf": (PALETTE[1], "-"), "whole_body": (PALETTE[0], (0, (4, 2)))}
_QUICK_DURATION = 0.5
"""Length of the quick version's only scenario [s]."""

Runs = dict[tuple[str, str], Run]
"""By scenario and controller."""

_PROSE = (
    "`humanoid33` stands on both feet in MuJoCo and does what shipped scenarios say, once under "
    "the operational space formulation with the `fused` formula (`osf`) and once under the "
    "hierarchical QP (`whole_body`), with the same stack and references. Contacts stand above all "
    "tasks in both. The QP treats cones, torque limits and joint limits as inequalities; `osf` "
    "chooses internal forces within the cones, holds joints at their limits, and lets tasks go "
    "from the bottom up where that is not enough.",
    "In `squat` the centre of mass goes 0.15 m down and up again while the hands stay in place. In "
    "`reach` both hands go to the edge of their reach, beyond it, and back: beyond it no "
    "controller can follow. There the two differ: `osf` lets go of a direction before the arm is "
    "quite straight and stops further from the target; the QP weighs the hands against the "
    "damping beside them in the same level, and stretches on.",
    "Tick times are of two runs one after the other; "
    "`python -m benchmarks tick --controller osf` compares "
    "them tick by tick in turn.",
)


def humanoid_section(options: StudyOptions, progress: Progress) -> Section:
    """Scenarios `squat` and `reach`; quick: a short `stand`."""
    names = ("stand",) if options.quick else ("squat", "reach")
    steps = Steps(progress, len(names) * len(_CONTROLLERS))
    runs: Runs = {}
    for name in names:
        # The bias acceleration is of the state that the controller is told: the true one here.
        scenario = replace(load_scenario(name), ground_truth=True)
        if options.quick:
            scenario = replace(scenario, duration=_QUICK_DURATION)
        for controller in _CONTROLLERS:
            show = steps.next()
            runs[name, controller] = run_scenario(
                replace(scenario, controller=ControllerPlan(name=controller), seed=options.seed),
                progress=lambda done, total, show=show: show(done / total),
            )
    steps.finish()
    return Section(
        prose=_PROSE,
        findings=tuple(_finding(name, runs) for name in names),
        figures=(_figure(names, runs),),
        tables=(_table(runs),),
    )


def _finding(name: str, runs: Runs) -> Finding:
    run, other = (runs[name, controller] for controller in _CONTROLLERS)
    failed = [check.name for check in run.checks if not check.ok]
    return Finding(
        name=f"humanoid33, scenario {name}, osf: checks that fail",
        ours=len(failed) + run.fell,
        ok=run.ok,
        note=("It does not fall, and every check of the scenario holds" if run.ok else "Failed: ")
        + ", ".join(failed)
        + f"; greatest error of the COM {1e3 * _com_error(run).max():.2f} mm, under whole_body "
        f"{1e3 * _com_error(other).max():.2f} mm.",
    )


def _table(runs: Runs) -> Table:
    rows: list[tuple[str | float, ...]] = []
    for (name, controller), run in runs.items():
        signals = run.signals
        tick = np.sum(list(signals.tick_us.values()), axis=0)
        hands = [1e3 * _greatest(signals.task_errors[h]) for h in ("left_hand", "right_hand")]
        rows.append(
            (
                name,
                controller,
                1e3 * float(_com_error(run).max()),
                *hands,
                1e3 * max(float(signals.task_errors[h][-1]) for h in ("left_hand", "right_hand")),
                100.0 * float(_torque_ratio(run).max()),
                float(np.sqrt((signals.torque**2).mean())),
                float(np.nanmedian(tick)),
                float(np.nanpercentile(tick, 99)),
            )
        )
    return Table(
        title="Standing, by controller",
        header="scenario | controller | max COM error [mm] | max left hand [mm] | "
        "max right hand [mm] | hands at the end [mm] | max torque to limit [%] | "
        "torque, rms [N m] | tick, median [µs] | tick, 99% [µs]",
        rows=tuple(rows),
        caption="Errors of the hands in `reach` are largest while the target is out of reach. In "
        "`stand` they hold position and orientation [mm, 0.001 rad].",
    )


def _figure(names: tuple[str, ...], runs: Runs) -> Figure:
    return draw(
        name="figure-humanoid",
        title="A standing humanoid under either controller",
        caption="Same robot, same stack, same references. Where the lines lie on one another both "
        "controllers do the same.",
        height=6.0,
        paint=lambda canvas: _paint(canvas, names, runs),
    )


def _paint(canvas: Any, names: tuple[str, ...], runs: Runs) -> None:
    panels = canvas.subplots(3, len(names), sharex="col", squeeze=False)
    for column, name in zip(panels.T, names, strict=True):
        for controller in _CONTROLLERS:
            run = runs[name, controller]
            signals = (
                1e3 * _com_error(run),
                1e3 * run.signals.task_errors["left_hand"],
                100.0 * _torque_ratio(run),
            )
            colour, dashes = _LOOKS[controller]
            for panel, values in zip(column, signals, strict=True):
                panel.plot(
                    *decimate(run.signals.time, values),
                    color=colour,
                    linestyle=dashes,
                    label=controller,
                )
        column[0].set_title(name, fontweight="normal")
        column[-1].set_xlabel("time [s]")
    for panel, what in zip(
        panels[:, 0],
        ("COM error [mm]", "left hand error [mm]", "largest torque\nto limit [%]"),
        strict=True,
    ):
        panel.set_ylabel(what)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside upper left", ncols=2)
    canvas.align_ylabels()


def _com_error(run: Run) -> Float64[np.ndarray, " T"]:
    return np.linalg.norm(run.signals.com_reference - run.signals.com, axis=1)


def _torque_ratio(run: Run) -> Float64[np.ndarray, " T"]:
    return np.max(np.abs(run.signals.torque) / run.signals.torque_max, axis=1)


def _greatest(values: Float64[np.ndarray, " T"]) -> float:
    return float(np.nanmax(values))
