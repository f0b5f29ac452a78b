"""First study, exact angles: the bias acceleration knows no gravity. Figure 5, and Mars."""

from typing import Any

import numpy as np
from jaxtyping import Float64

from benchmarks.drawing import PALETTE
from benchmarks.rigid_plant import Gravity
from poise.robots import load_robot
from studies.bias_acceleration.controller import OldGravityRecursion
from studies.bias_acceleration.cup import DURATION, KP, PAPER_GRAVITY, CupRun, CupTrace, carry_cup
from studies.bias_acceleration.side_by_side import SideBySide, compare_along
from studies.bias_acceleration.signals import degrees_most, draw_signal
from studies.finding import Figure, Finding, Section, Table, draw, one_legend
from studies.plan import Progress, Steps, StudyOptions

MARS = -3.71
"""Vertical gravity on Mars [m/s^2]."""

ROUNDING = 1e-9
"""Relative size below which a difference is rounding: 1e-16, amplified by differences over 1 ms."""

_RUN_SHARE = 0.01
"""Two runs count as the same where they differ by no more than a line's width in a figure."""

_PROSE = (
    "The robot is `arm6`, made for this study after the paper's sketch, because the paper's own "
    "(an INDY RP) is not published with its parameters. It starts with the hand at y = −0.2 m, "
    "level, joints at (−21°, 29°, 69°, 0°, 83°, 0°): elbow and wrist are well bent, and every "
    "level keeps its full rank along the whole way, which is checked. The hand goes 0.4 m along y "
    "in 4.2 s on a cubic (task 1), and keeps its orientation (task 2). Both tasks have "
    "`kp` = 100 1/s² and critical damping; the paper does not give its gains.",
    "The true robot is integrated by the classic Runge-Kutta method with steps of 0.1 ms; the "
    "controller acts every 1 ms and its torque is held in between. Angles are exact here. "
    "Gravity either stays at −9.8 m/s² or is swept from there to 9.8 m/s², and the controller "
    "is told which.",
    "Two runs are not quite enough to compare: while a torque is held, changing gravity moves the "
    "robot a little, so that the states differ. So the formulas are also evaluated on the states "
    "of one and the same run, once told constant gravity and once the swept one.",
)


def gravity_section(options: StudyOptions, progress: Progress) -> Section:
    """Figure 5, and the controller that goes to Mars."""
    steps = Steps(progress, 8)
    share = 0.1 if options.quick else 1.0
    # A quick run is shorter, not faster: it sees the first part of the sweep.
    sweep = Gravity(first=PAPER_GRAVITY, last=-PAPER_GRAVITY, duration=DURATION)
    constant = carry_cup(CupRun(formula="original", share=share), steps.next())
    swept = carry_cup(CupRun(formula="original", share=share, gravity=sweep), steps.next())
    told_constant = compare_along(constant, KP, progress=steps.next())
    told_swept = compare_along(
        constant,
        KP,
        gravity=np.linspace(PAPER_GRAVITY, -PAPER_GRAVITY, len(constant.time)),
        progress=steps.next(),
    )
    mars = Gravity(first=MARS)
    there = {
        name: carry_cup(
            CupRun(formula=name, derivative="exact", share=share, gravity=mars), steps.next()
        )
        for name in ("original", "proposed", "fused")
    }
    old = OldGravityRecursion(load_robot("arm6"), PAPER_GRAVITY)
    there["original, its μ + p with Earth's gravity"] = carry_cup(
        CupRun(formula="original", derivative="exact", share=share, gravity=mars),
        steps.next(),
        recursion=old,
    )
    return Section(
        prose=_PROSE,
        findings=(
            *_independence(told_constant, told_swept),
            _runs(constant, swept),
            *_on_mars(there),
            _regular((constant, swept, *there.values())),
        ),
        figures=(_figure_5(constant, swept, told_swept.bias["original"]),),
        tables=(_mars_table(there),),
    )


def _independence(constant: SideBySide, swept: SideBySide) -> list[Finding]:
    findings: list[Finding] = []
    for formula in ("original", "proposed"):
        before, after = constant.bias[formula], swept.bias[formula]
        largest = float(np.linalg.norm(after - before, axis=1).max())
        findings.append(
            Finding(
                name=f"Figure 5: change of the {formula} bias acceleration with gravity",
                paper=0.0,
                ours=float(np.degrees(largest)),
                unit="°/s²",
                ok=largest < ROUNDING * _size(before),
                note="“identical”: at rounding level, on the same states; the bias acceleration "
                f"itself reaches {np.degrees(_size(before)):.1f} °/s².",
            )
        )
    return findings


def _runs(constant: CupTrace, swept: CupTrace) -> Finding:
    largest = float(np.linalg.norm(swept.bias - constant.bias, axis=1).max())
    return Finding(
        name="Figure 5: change of the original bias acceleration between the two runs",
        paper=0.0,
        ours=float(np.degrees(largest)),
        unit="°/s²",
        ok=largest < _RUN_SHARE * _size(constant.bias),
        note="“identical”, as far as one sees in the figure: below 1% of the bias acceleration. "
        "What is left is no property of the formula: the torque is held for 1 ms while gravity "
        "goes on changing, so that the two robots are not in quite the same state.",
    )


def _on_mars(there: dict[str, CupTrace]) -> list[Finding]:
    *told, (_, old) = there.items()
    findings = [
        Finding(
            name=f"Mars: greatest σ with the {name} formula",
            ours=degrees_most(trace.sigma),
            unit="°/s²",
            ok=float(trace.sigma.max()) < ROUNDING * _size(there["original"].bias),
            note=note,
        )
        for (name, trace), note in zip(
            told,
            (
                "Correct as long as its bias term is told of Mars, too.",
                "Its bias term has no gravity in it: nothing in it was changed.",
                "Likewise; only h in the torque is told of Mars.",
            ),
            strict=True,
        )
    ]
    findings.append(
        Finding(
            name="Mars: greatest σ with an original formula that is not told",
            ours=degrees_most(old.sigma),
            unit="°/s²",
            ok=degrees_most(old.sigma) > 1e6 * degrees_most(there["proposed"].sigma),
            note="“the original … requires the change of the value of gravitational acceleration”: "
            "it does. The torque knows Mars; only the formula's own μᵢ + pᵢ has −9.8 m/s². The "
            f"cup tilts by {degrees_most(old.tilt):.1f}°.",
        )
    )
    return findings


def _regular(traces: tuple[CupTrace, ...]) -> Finding:
    lost = sum(not trace.regular for trace in traces)
    held = sum(trace.held for trace in traces)
    return Finding(
        name="runs in which a task lost rank, or ticks at a joint's limit",
        ours=lost + held,
        ok=lost + held == 0,
        note="None: the whole way is clear of singularities and limits, so that neither the "
        "treatment of lost ranks nor of limits has a part in these numbers.",
    )


def _mars_table(there: dict[str, CupTrace]) -> Table:
    return Table(
        title="On Mars, gravity 3.71 m/s²",
        header="formula | max σ [°/s²] | max tilt [°] | max distance from the target [mm]",
        rows=tuple(
            (
                name,
                degrees_most(trace.sigma),
                degrees_most(trace.tilt),
                1e3 * float(trace.distance.max()),
            )
            for name, trace in there.items()
        ),
        caption="Exact angles, exact derivatives. The tilt of the first three comes from holding "
        "the torque for 1 ms. Task 1 does not suffer in the last row: it stands above.",
    )


def _size(bias: Float64[np.ndarray, "T 3"]) -> float:
    return float(np.linalg.norm(bias, axis=1).max())


def _figure_5(
    constant: CupTrace, swept: CupTrace, on_same_states: Float64[np.ndarray, "T 3"]
) -> Figure:
    return draw(
        name="figure-5",
        title="Figure 5: two gravities, one bias acceleration",
        caption="The original formula's bias acceleration of the second task, by world axis. The "
        "dotted line, from the states of the first run but told the swept gravity, lies on the "
        "first. The second run differs a little, which shows in the small y: its robot hangs "
        "back while each torque is held and gravity goes on, and its feedback says so.",
        height=5.6,
        paint=lambda canvas: _paint_5(canvas, constant, swept, on_same_states),
    )


def _paint_5(
    canvas: Any, constant: CupTrace, swept: CupTrace, on_same_states: Float64[np.ndarray, "T 3"]
) -> None:
    top, *panels = canvas.subplots(4, 1, sharex=True)
    time = constant.time
    looks: tuple[tuple[str, dict[str, Any]], ...] = (
        ("constant gravity", {"color": PALETTE[0], "linestyle": "-", "linewidth": 2.2}),
        ("swept gravity", {"color": PALETTE[1], "linestyle": (0, (4, 3))}),
        (
            "states of the first run, told the swept gravity",
            {"color": "#1F2933", "linestyle": (0, (1, 4)), "linewidth": 1.1},
        ),
    )
    top.plot(time, constant.gravity, **looks[0][1])
    top.plot(time, swept.gravity, **looks[1][1])
    top.set_ylabel("gravity [m/s²]")
    signals = (constant.bias, swept.bias, on_same_states)
    for axis, panel in enumerate(panels):
        for (label, look), bias in zip(looks, signals, strict=True):
            draw_signal(panel, time, np.degrees(bias[:, axis]), "original", label=label, **look)
        panel.set_ylabel(f"bias {'xyz'[axis]} [°/s²]")
    panels[-1].set_xlabel("time [s]")
    one_legend(canvas, panels[0])
    canvas.align_ylabels()
