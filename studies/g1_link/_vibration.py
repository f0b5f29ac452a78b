"""`vibration_section`: where a G1 vibrates under torques from a computer, and what damping does."""

import itertools
import math
from typing import Any

from studies.finding import Cell, Figure, Finding, Section, Table, draw
from studies.g1_link._standing import Standing, Vibration, run_standing
from studies.plan import Progress, Steps, StudyOptions

_CROSSING = math.sqrt(0.5 * (1.0 + math.sqrt(1.25)))
EDGE = math.atan(4.0 * _CROSSING) / _CROSSING
"""Largest kd T of a critically damped loop with delay T, 1.29.

A task makes accelerations -(kd s + kp) x with kp = kd^2 / 4; after a delay the loop is
s^2 + (kd s + kp) exp(-s T). With s = i w kd its gain is one at w^4 = w^2 + 1 / 16, so
w^2 = (1 + sqrt(5 / 4)) / 2, and its phase is -pi there with w kd T = atan(4 w)."""

MARGIN = 2.0
"""Gain margin of a loop that counts as stable, the 6 dB of textbooks: nearer to its edge it rings
by itself after any disturbance."""

WAYS: dict[str, dict[str, Any]] = {
    "published friction": {"ripple": None},
    "ripple as large as friction": {"ripple": 1.0},
    "no friction": {"ripple": None, "friction": 0.0},
}

_PROSE = (
    "A G1 stands and sways by 1 cm at 1 Hz under `default_stack`, a state estimator and the motors "
    "of `MotorConfig.g1()`, by pure torques at 500 Hz or with damping in the drives that "
    "`TorqueSplit` adds: kd = I / T with the inertia I of a rotor at its joint and the 4 ms T in "
    "which the computer cannot react. The gains of the stack are those of the default, and factors "
    "on its damping with their squares on its stiffness.",
    "A joint vibrates where its velocity above 20 Hz is more than the noise that quantisation "
    "leaves in its measurement: below that the drives cannot tell it. A loop of damping gain kd "
    "[1/s] and delay T oscillates by itself beyond kd T = 1.29; its gain margin is 6 dB at half of "
    "that.",
)

Outcome = tuple[str, Standing, Vibration]


def run(quick: bool) -> Section:
    """Run this part alone."""
    return vibration_section(StudyOptions(quick=quick), lambda _done, _total: None)


def vibration_section(options: StudyOptions, progress: Progress) -> Section:
    """Sweep ripple, friction, latency, gains of the stack and damping of the drives."""
    outcomes, grid = list[Outcome](), _grid(options)
    steps = Steps(progress, len(grid))
    for way, trial in grid:
        steps.next()
        outcomes.append((way, trial, run_standing(trial)))
    steps.finish()
    return Section(
        prose=_PROSE,
        findings=_findings(outcomes),
        figures=(_figure(outcomes),),
        tables=(_table(outcomes),),
    )


def _grid(options: StudyOptions) -> list[tuple[str, Standing]]:
    ways = list(WAYS)[:1] if options.quick else list(WAYS)
    latencies = (1e-3, 12e-3) if options.quick else (1e-3, 6e-3, 12e-3)
    factors = (1.0, 8.0) if options.quick else (1.0, 4.0, 8.0)
    seconds = 1.5 if options.quick else 2.5  # one and two periods of the sway are measured
    return [
        (
            way,
            Standing(
                latency=latency,
                damped=damped,
                stiffness=factor,
                seconds=seconds,
                seed=options.seed,
                **WAYS[way],
            ),
        )
        for way, damped, factor, latency in itertools.product(
            ways, (False, True), factors, latencies
        )
    ]


def _findings(outcomes: list[Outcome]) -> tuple[Finding, ...]:
    pure = [o for o in outcomes if not o[1].damped]
    default = [v for way, t, v in pure if t.stiffness == 1.0 and way == "published friction"]
    quiet = max(v.ratio for v in default)
    below = max(v.ratio for _, t, v in outcomes if MARGIN * v.gain * t.delay < EDGE)
    beyond = min(v.ratio for _, t, v in outcomes if v.gain * t.delay > EDGE)
    damping = [
        damped.ratio / free.ratio
        for way, t, free in pure
        for other, s, damped in outcomes
        if s.damped and (way, t.latency, t.stiffness) == (other, s.latency, s.stiffness)
        if t.stiffness == 1.0
    ]
    gain = math.exp(sum(math.log(ratio) for ratio in damping) / len(damping))
    falls = sum(v.fell for _, _, v in outcomes)
    return (
        Finding(
            name="pure torque, default gains, published friction: largest velocity over noise",
            ours=quiet,
            paper=1.0,
            ok=quiet <= 1.0,
            note=f"latencies up to {1e3 * max(t.latency for _, t, _ in pure):g} ms; a bound of "
            "ours: less than quantisation leaves in the drives' velocities",
        ),
        Finding(
            name="least velocity beyond kd T = 1.29 over the largest below half of it",
            ours=beyond / below,
            paper=1.0,
            ok=beyond > below,
            note=f"at most {below:.3g} times the noise below, at least {beyond:.3g} beyond, with "
            "and without damping in the drives",
        ),
        Finding(
            name="damping in the drives, default gains: velocity over that by pure torque",
            ours=gain,
            paper=1.0,
            ok=gain < 1.0,
            note="geometric mean over latencies, ripple and friction; stiffer stacks gain nothing",
        ),
        Finding(name="falls", ours=falls, paper=0, ok=falls == 0, note=f"of {len(outcomes)} runs"),
    )


def _figure(outcomes: list[Outcome]) -> Figure:
    def paint(canvas: Any) -> None:
        panels = canvas.subplots(1, 2, sharex=True, sharey=True)
        for damped, panel in enumerate(panels):
            for way, marker in zip(WAYS, "os^", strict=True):
                chosen = [(t, v) for w, t, v in outcomes if w == way and t.damped == bool(damped)]
                across = [v.gain * t.delay for t, v in chosen]
                panel.plot(across, [v.ratio for _, v in chosen], marker, label=way, alpha=0.8)
            panel.axvline(EDGE, color="0.4", linestyle="--", linewidth=1.0)
            panel.axhline(1.0, color="0.4", linewidth=1.0)
            panel.set(xscale="log", yscale="log", xlabel="kd T of the stack")
            panel.xaxis.set_major_formatter("{x:g}")
            panel.yaxis.set_major_formatter("{x:g}")
            panel.set_title("kd = I / T in the drives" if damped else "pure torque")
        panels[0].set_ylabel("velocity above 20 Hz over noise")
        panels[0].legend(loc="upper left")

    return draw(
        "vibration",
        "Vibration of the worst joint",
        "Each point is a run of the worst joint; kd T is the largest damping gain of the stack by "
        "the delay of its loop. Below the line at 1 no joint moves more than its encoder's noise; "
        "right of the dashed one a delayed loop oscillates by itself.",
        4.5,
        paint,
    )


def _table(outcomes: list[Outcome]) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            way,
            1e3 * trial.latency,
            found.gain,
            "damped" if trial.damped else "pure torque",
            found.gain * trial.delay,
            found.ratio,
            found.joint,
            found.speed,
            found.torque,
            "fell" if found.fell else "",
        )
        for way, trial, found in outcomes
    ]
    return Table(
        title="All runs",
        header="motors | latency [ms] | stack's kd [1/s] | drives | kd T | velocity over noise | "
        "joint | velocity [rad/s] | torque [N m] | fell",
        rows=tuple(rows),
        caption="Velocities and commanded torques are RMS above 20 Hz.",
    )
