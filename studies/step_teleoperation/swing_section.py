"""Scenario 4: the foot in the air is swung fast, with the body rotator and without.

With Poise's constant weights, with the paper's own, and by the paper's rules alone.
"""

from typing import Any, Literal, NamedTuple

import numpy as np

from benchmarks.drawing import PALETTE, REFERENCE
from poise.apps.teleoperation import SCRIPTS, Script, TeleopRun
from poise.locomotion import Mode, StepTeleoperator
from poise.robots import Robot, load_robot
from studies.finding import Cell, Figure, Finding, Section, Table, draw
from studies.plan import Progress, Steps, StudyOptions
from studies.step_teleoperation.literal import (
    AS_MEASURED,
    LiteralTeleoperator,
    PaperDoubleWeights,
    PaperWeights,
)
from studies.step_teleoperation.pictures import films, snapshots
from studies.step_teleoperation.runs import (
    SOFT,
    STIFF,
    constants,
    fall_note,
    least_margin,
    run_script,
)

_FIRST_SWING = 3.0
"""When the script begins to swing [s]."""

Way = Literal["forward", "sideways"]
WAYS: tuple[Way, ...] = ("forward", "sideways")

_ENOUGH = 2.0
"""Without over with rotator from which on we call the ZMP's motion “much smaller”."""

_PAPER_ON, _PAPER_OFF = "(39c), on", "(39d), off"
_WORDED_OFF = "(39c), off, as the paper's words have it"
_ALONE = "the paper's rules alone"

Leaders = dict[str, tuple[type[StepTeleoperator], bool]]
"""Teleoperator of a run, with or without the rotator."""

_WEIGHTED: Leaders = {
    "constant, on": (StepTeleoperator, True),
    "constant, off": (StepTeleoperator, False),
    _PAPER_ON: (PaperWeights, True),
    _PAPER_OFF: (PaperDoubleWeights, False),
    _WORDED_OFF: (PaperWeights, False),
}
"""By Poise's rules, with its own constant weights and with the paper's."""

_LITERAL: Leaders = {"on": (LiteralTeleoperator, True), "(39c), off": (LiteralTeleoperator, False)}
"""By the paper's rules alone, as its words have it."""

_SETTINGS = {
    f"servos {SOFT}": (SOFT, AS_MEASURED),
    f"servos {STIFF}": (STIFF, AS_MEASURED),
    f"servos {STIFF}, ZMP smoothed": (STIFF, {}),
}
"""Servos and changes of the paper's rules."""


class SwingFigures(NamedTuple):
    """What is measured of a swing.

    Attributes:
        peak_to_peak: of the ZMP along the swing [mm].
        deviation: its standard deviation [mm].
        travel: of the foot [mm].
        error: of the foot, root of the mean square [mm].
    """

    peak_to_peak: float
    deviation: float
    travel: float
    error: float


def swing_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot("biped20")
    steps = Steps(progress, (len(_WEIGHTED) + len(_SETTINGS) * len(_LITERAL)) * len(WAYS))
    figures: list[Figure] = []
    findings: list[Finding] = []
    rows: list[tuple[Cell, ...]] = []
    notes: tuple[str, ...] = ()
    shown: list[tuple[str, str, TeleopRun]] = []
    for way in WAYS:
        axis = WAYS.index(way)
        script = SCRIPTS["swing_fast"](robot, way, 2 if options.quick else 3)
        runs = _led(robot, script, _WEIGHTED, steps)
        on, off = runs["constant, on"], runs["constant, off"]
        findings += _findings(way, runs, axis)
        rows += [_row(way, name, run, axis) for name, run in runs.items()]
        for setting, (servos, changes) in _SETTINGS.items():
            with constants(changes):
                runs = _led(robot, script, _LITERAL, steps, servos=servos)
            rules = f"{_ALONE}, {setting}"
            findings.append(_rescued(f"swing {way}, {rules}", list(runs.values()), axis))
            rows += [_row(way, f"{rules}, {name}", run, axis) for name, run in runs.items()]
        figures.append(_figure(way, axis, on, off))
        if way == "forward":
            pictures, notes = snapshots(
                options,
                "figure-13",
                "Figure 13: a fast swing forward, body rotator on and off",
                "With the rotator the torso leans against the swing.",
                [("on", on, (3.0, 3.2, 3.4, 3.8, 4.2)), ("off", off, (3.0, 3.2, 3.4, 3.8, 4.2))],
                azimuth=90.0,
            )
            figures[-1:-1] = pictures
        shown += [
            (f"scenario-4-{way}-{name}", f"Scenario 4, {way}, rotator {name}", run)
            for name, run in (("on", on), ("off", off))
        ]
    steps.finish()
    return Section(
        prose=(
            "On the left leg the right foot is swung out and back, each way in 0.3 s. For the "
            "disabled rotator the paper says that W_A is “always set as (39c)”; we read (39d), "
            "because (39c) with the rotator's momentum at zero would still hold the angular "
            "momentum at zero, by weight. Both readings are findings. Weights are Poise's constant "
            "ones, except where (39c) or (39d) is said: with the paper's own the rotator makes the "
            "ZMP's largest excursion little smaller, as each weight follows the very error that it "
            "makes, so that claim does not come out. The last rows of each way are the "
            "paper's rules alone, (39c) with the rotator and without it, on Poise's servos and on "
            "stiff ones, and there with a smoothed ZMP, too; numbers of a fall are left out.",
            *notes,
        ),
        findings=tuple(findings),
        figures=tuple(figures),
        films=films(options, shown),
        tables=(
            Table(
                title="A fast swing",
                header="way | weights, rotator | robot | ZMP peak to peak [mm] | deviation [mm] "
                       "| foot travel [mm] | foot error, rms [mm] | ZMP to edge, least [mm] "
                       "| torso, most [rad]",
                rows=tuple(rows),
            ),
        ),
    )  # fmt: skip


def _led(
    robot: Robot, script: Script, leaders: Leaders, steps: Steps, **changes: Any
) -> dict[str, TeleopRun]:
    """The same swing under each leader; `changes` go to `run_script`."""
    runs: dict[str, TeleopRun] = {}
    for name, (leader, rotator) in leaders.items():
        steps.next()
        runs[name] = run_script(robot, script, leader=leader, rotator=rotator, **changes)
    return runs


def swings(run: TeleopRun) -> bool:
    """Return whether the right foot is in the air when the script begins to swing it."""
    return bool((run.log.when(Mode.SL) & (run.log.time > _FIRST_SWING)).any())


def measure(run: TeleopRun, axis: int) -> SwingFigures:
    """Numbers of a swing along an axis, from its first start on."""
    log = run.log
    rows = log.time > _FIRST_SWING
    zmp, foot = log.zmp[rows, axis], log.soles[rows, 1, axis]
    error = foot - log.target[rows, axis]
    return SwingFigures(
        1e3 * float(np.ptp(zmp)),
        1e3 * float(zmp.std()),
        1e3 * float(np.ptp(foot)),
        1e3 * float(np.sqrt(np.nanmean(error * error))),
    )


def _row(way: Way, name: str, run: TeleopRun, axis: int) -> tuple[Cell, ...]:
    numbers: tuple[Cell, ...] = (None,) * 5
    if not run.fell:
        numbers = (*measure(run, axis), least_margin(run, _FIRST_SWING))
    swung = "" if swings(run) else ", no swing"
    return (way, name, fall_note(run) + swung, *numbers, float(run.log.tilt.max()))


_WEIGHTS = {
    "constant weights": ("constant, on", "constant, off"),
    "(39c), (39d) without rotator": (_PAPER_ON, _PAPER_OFF),
    "(39c) always": (_PAPER_ON, _WORDED_OFF),
}
"""What is compared, with the rotator and without it."""


def _findings(way: Way, runs: dict[str, TeleopRun], axis: int) -> list[Finding]:
    """The paper's two claims, the first with each set of weights."""
    findings: list[Finding] = []
    for weights, (on, off) in _WEIGHTS.items():
        stood = not (runs[on].fell or runs[off].fell)
        with_it, without = measure(runs[on], axis), measure(runs[off], axis)
        for what, ratio in (
            ("ZMP peak to peak", without.peak_to_peak / with_it.peak_to_peak),
            ("standard deviation of the ZMP", without.deviation / with_it.deviation),
        ):
            findings.append(
                Finding(name=f"swing {way}, {weights}: {what} without over with rotator",
                        ours=ratio, ok=stood and ratio >= _ENOUGH,
                        note="“much smaller with the body rotator”; asked: at least "
                             f"{_ENOUGH:g}")
            )  # fmt: skip
    on, off = runs["constant, on"], runs["constant, off"]
    travel = measure(on, axis).travel / measure(off, axis).travel
    stood = not (on.fell or off.fell)
    findings.append(
        Finding(name=f"swing {way}: travel of the foot with over without rotator", paper=1.0,
                ours=travel, ok=stood and abs(travel - 1.0) <= 0.1,
                note="“almost the same foot motions”; asked: within 10%")
    )  # fmt: skip
    return findings


def _rescued(name: str, runs: list[TeleopRun], axis: int) -> Finding:
    """Compare runs of the paper's rules with and without the rotator."""
    on, off = runs
    note = "“effective”; asked: with it the robot swings its foot and stands. "
    stood = swings(on) and not on.fell
    if on.fell or off.fell:
        longer = float(on.log.time[-1] - off.log.time[-1])
        return Finding(name=f"{name}: on its feet longer with the rotator than without",
                       ours=longer, unit="s", ok=stood and longer > 0.0,
                       note=note + "Without it the paper's robot stands, too")  # fmt: skip
    ratio = measure(off, axis).peak_to_peak / measure(on, axis).peak_to_peak
    return Finding(name=f"{name}: ZMP peak to peak without over with rotator",
                   ours=ratio, ok=stood and ratio >= _ENOUGH,
                   note=f"{note}Asked: at least {_ENOUGH:g}")  # fmt: skip


def _figure(way: Way, axis: int, on: TeleopRun, off: TeleopRun) -> Figure:
    def paint(canvas: Any) -> None:
        above, below = canvas.subplots(2, 1, sharex=True)
        for run, colour, name in ((on, PALETTE[0], "rotator on"), (off, PALETTE[1], "rotator off")):
            rows = run.log.time > _FIRST_SWING - 0.5
            time = run.log.time[rows]
            above.plot(time, run.log.soles[rows, 1, axis], color=colour, label=name)
            below.plot(time, run.log.zmp[rows, axis], color=colour)
        rows = on.log.time > _FIRST_SWING - 0.5
        above.plot(
            on.log.time[rows], on.log.target[rows, axis], color=REFERENCE, linestyle="--",
            label="commanded",
        )  # fmt: skip
        sole = next(iter(on.plant.robot.soles.values()))
        half = 0.5 * (sole.length if axis == 0 else sole.width)
        centre = float(on.log.soles[-1, 0, axis])
        for edge in (centre - half, centre + half):
            below.axhline(edge, color=PALETTE[1], linewidth=0.8)
        above.set_ylabel("foot [m]")
        below.set_ylabel("ZMP [m]")
        below.set_xlabel("time [s]")
        above.legend(loc="upper right", ncols=3)

    return draw(
        name=f"figure-14-{way}",
        title=f"Figure 14: swinging {way}, rotator on and off",
        caption="Above the foot, below the ZMP along the swing with the edges of the sole that "
        "carries.",
        height=4.4,
        paint=paint,
    )
