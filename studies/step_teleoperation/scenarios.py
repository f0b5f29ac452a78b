"""Sections of the paper's scenarios 1 to 4 on `biped20`, and of 1 to 3 on G1."""

from collections import deque
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64

from poise.apps.teleoperation import SCRIPTS, Script, TeleopRun
from poise.locomotion import Mode, PreviewControl, StepTeleoperator
from poise.robots import Robot, catalog, load_robot
from studies.finding import Cell, Figure, Finding, Section, Table, draw, one_legend
from studies.plan import Progress, Steps, StudyOptions
from studies.step_teleoperation.literal import (
    LiteralTeleoperator,
    PaperDoubleWeights,
    PaperWeights,
    zmp_as_measured,
)
from studies.step_teleoperation.runs import (
    SOFT,
    STIFF,
    Servos,
    beyond,
    fall_note,
    first,
    least_margin,
    left_undone,
    run_script,
    script_parameters,
)

Panel = tuple[str, TeleopRun, int]
"""Title, run and axis (0 ahead, 1 left) of a panel of a figure."""


def _figure(
    name: str, title: str, caption: str, panels: Sequence[Panel], span: tuple[float, float]
) -> Figure:
    """Draw ZMP, CoM and reference over a span of time [s], with the changes of the mode."""

    def paint(canvas: Any) -> None:
        axes = canvas.subplots(1, len(panels), sharey=True)
        for panel, (words, run, axis) in zip(axes, panels, strict=True):
            log = run.log
            rows = (log.time >= span[0]) & (log.time <= span[1])
            for values, colour, style, label in (
                (log.zmp, "C1", "-", "ZMP"),
                (log.com, "C0", "-", "CoM"),
                (log.zmp_reference, "dimgrey", "--", "ZMP reference"),
            ):
                panel.plot(
                    log.time[rows], values[rows, axis], color=colour, linestyle=style, label=label
                )
            for i in np.flatnonzero(np.diff(log.mode)) + 1:
                if rows[i]:
                    panel.axvline(log.time[i], color="grey", linewidth=0.7)
                    panel.annotate(
                        tuple(Mode)[log.mode[i]].name, (log.time[i], 1.01), fontsize=7,
                        color="grey", xycoords=panel.get_xaxis_transform(),
                    )  # fmt: skip
            panel.set_title(words, fontweight="normal", pad=14)
            panel.set_xlabel("time [s]")
            panel.set_ylabel(("x forward [m]", "y left [m]")[axis])
        one_legend(canvas, axes[0])

    return draw(name=name, title=title, caption=caption, height=3.8, paint=paint)


_ASIDE = 0.06
"""Distance by which the right foot goes to the right in the second run of scenario 1 [m]; the paper
gives no number."""


def obstacle_section(_options: StudyOptions, progress: Progress) -> Section:
    """Scenario 1: two steps over two blocks, straight ahead, and to the right as in the paper."""
    robot = load_robot("biped20")
    script = SCRIPTS["over_an_obstacle"](robot)
    run = run_script(robot, script)
    progress(1.0, 2.0)
    right_forward = SCRIPTS["over_an_obstacle"](robot, _ASIDE)
    as_paper = run_script(robot, right_forward)
    progress(2.0, 2.0)

    def row(way: str, run: TeleopRun, script: Script) -> tuple[Cell, ...]:
        soles = 1e3 * (run.log.soles - run.log.soles[0])
        heights = " and ".join(f"{soles[:, foot, 2].max():.0f}" for foot in (1, 0))
        ahead = 1e3 * beyond(robot, run.log, script)
        return way, fall_note(run), heights, ahead, float(run.log.tilt.max()), least_margin(run)

    return Section(
        prose=(
            "Right foot, then left foot over two blocks, 5 and 8 cm high, right across the way. "
            "The paper does not give the blocks; a foot of 0.30 m has to land beyond both, which "
            "makes a step of 0.43 m. The feet begin 0.27 m apart, where legs reach farthest; the "
            "CoM comes down where they have to (rule `stooping`).",
        ),
        findings=(
            Finding(
                name="scenario 1: both feet beyond both blocks",
                ours=1e3 * beyond(robot, run.log, script),
                unit="mm",
                ok=not left_undone(robot, run, script),
                note="distance of the nearer heel behind the second block at the end",
            ),
            Finding(
                name="scenario 1: nearest that the robot came to a block",
                ours=None if run.clearance is None else 1e3 * run.clearance,
                unit="mm",
                ok=not run.fell and (run.clearance or 0.0) > 0.0,
                note="no touch",
            ),
            Finding(
                name="scenario 1 to the right and forward: both feet beyond both blocks",
                ours=1e3 * beyond(robot, as_paper.log, right_forward),
                unit="mm",
                ok=not left_undone(robot, as_paper, right_forward),
                note=f"the right foot is sent {1e3 * _ASIDE:.0f} mm to the right; no touch",
            ),
        ),
        tables=(
            Table(
                title="Two ways over the blocks",
                header="the right foot goes | robot | highest, right and left foot [mm] | "
                "ahead of the blocks [mm] | torso, most [rad] | ZMP to edge, least [mm]",
                rows=(
                    row("straight ahead", run, script),
                    row("to the right and forward, as in the paper", as_paper, right_forward),
                ),
                caption="The ZMP passes the polygon's edge where a foot lifts or lands.",
            ),
        ),
        figures=(
            _figure(
                "figure-8",
                "Figure 8: ZMP and CoM over the obstacle",
                "The ZMP first moves the other way when its reference jumps, then converges. "
                "Letters are modes.",
                [("ahead", run, 0), ("sideways", run, 1)],
                (0.2, script.duration),
            ),
        ),
    )


class PreviewDriver:
    """A `poise.locomotion.ComDriver`: the reference goes through a buffer of N ticks first.

    The controller takes the reference of N ticks ago for the present one; the buffer holds the
    ones after it. So a reference that jumps acts N T later, and the ZMP begins to move earlier.
    """

    def __init__(self, height: float, dt: float, length: int) -> None:
        self.control = PreviewControl(height, dt, length)
        self.omega = self.control.omega
        self._buffer: deque[Float64[np.ndarray, "2"]] = deque(maxlen=length)
        self._acceleration = np.zeros(2)

    def drive(
        self,
        reference: Float64[np.ndarray, "2"],
        position: Float64[np.ndarray, "2"],
        velocity: Float64[np.ndarray, "2"],
        dt: float,
    ) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
        """Advance by a tick, with the position fed back."""
        del dt
        missing = self.control.length - len(self._buffer)
        self._buffer.extend([reference.copy()] * max(missing, 1))
        state = np.stack((position, velocity, self._acceleration))
        jerk = self.control.jerk(state, np.stack(self._buffer))
        _, velocity, self._acceleration = self.control.advance(state, jerk)
        return velocity, self._acceleration

    def restart(
        self, commanded: Float64[np.ndarray, "2"], measured: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """Keep the commanded velocity: the pattern goes on across modes."""
        del measured
        return commanded


_LENGTHS = (240, 120)
_LIFTED, _STEADY = 0.565, (3.0, 4.4)
"""Time at which the script lifts the right device, as in the paper, and span over which the ZMP
counts as steady [s]."""


def lift_section(_options: StudyOptions, progress: Progress) -> Section:
    """Scenario 2: from the lifted device to the lifted foot, by CoM shifter and preview control."""
    robot = load_robot("biped20")
    script = SCRIPTS["lift_one_foot"](robot)
    dt = script_parameters(robot, script).dt
    steps = Steps(progress, 3 + len(_LENGTHS))
    steps.next()
    runs = {"CoM shifter": run_script(robot, script)}
    expected: dict[str, tuple[float, tuple[float, float], float, str]] = {
        "CoM shifter": (0.5, (0.45, 0.55), 0.0, "around 0.5 s, no steady error")
    }
    for length in _LENGTHS:
        steps.next()
        driver = PreviewDriver(script.com_height, dt, length)
        name, nominal = f"preview control, N = {length}", length * dt
        runs[name] = run_script(robot, script, driver=driver, rotator=False)
        # The gain acts on the whole step, from the middle to the foot.
        predicted = -1e3 * (1.0 - driver.control.dc_gain) * 0.5 * script.feet_apart
        note = f"N T; its DC gain {driver.control.dc_gain:.3f} predicts {predicted:.1f} mm"
        expected[name] = nominal, (0.93 * nominal, 1.1 * nominal), predicted, note
    findings: list[Finding] = []
    for name, (paper, bounds, steady, note) in expected.items():
        run = runs[name]
        event, error = _since(first(run.log, Mode.SL)), _error(run)
        findings += [
            Finding(
                name=f"e_TS after the lift event, {name}",
                paper=paper,
                ours=event,
                unit="s",
                ok=not run.fell and event is not None and bounds[0] <= event <= bounds[1],
                note=f"{note}; asked: {bounds[0]:.2f} to {bounds[1]:.2f} s",
            ),
            Finding(
                name=f"steady error of the ZMP, {name}",
                paper=0.0 if name == "CoM shifter" else None,
                ours=error,
                unit="mm",
                ok=not run.fell and error is not None and abs(error - steady) <= 2.0,
                note=f"{note}; asked: within 2 mm",
            ),
        ]
    for servos in (SOFT, STIFF):
        steps.next()
        name = f"the paper's rules and no others, servos {servos}"
        with zmp_as_measured():
            run = run_script(robot, script, servos, leader=LiteralTeleoperator)
        runs[name] = run
        undone = left_undone(robot, run, script)
        findings.append(
            Finding(
                name=f"{name}: time on one foot",
                paper=script.duration - _LIFTED - 0.5,
                ours=dt * int(run.log.when(Mode.SL).sum()),
                unit="s",
                ok=not undone,
                note=", ".join(undone) or "the paper's robot lifts its foot in around 0.5 s",
            )
        )
    steps.finish()
    shown = [(name, run, 1) for name, run in runs.items() if name in expected]
    return Section(
        prose=(
            "Feet 0.42 m apart and CoM 0.765 m high, as in the paper, so that `r_lift` is its "
            "0.12 m. Preview control drives the CoM in place of the shifter, with the body "
            "rotator off: its steady error of the ZMP would wind the torso up. By the paper's "
            "rules alone the robot falls on Poise's servos, and stands on both feet on stiff ones, "
            "as (14e) holds for a moment, and the foot that still carries has landed.",
        ),
        findings=tuple(findings),
        figures=(
            _figure(
                "figure-10",
                "Figure 10: from double to single support",
                f"The right device is lifted at {_LIFTED} s; SL begins with the event e_TS.",
                shown,
                (0.3, 2.6),
            ),
        ),
        tables=(
            Table(
                title="Lifting one foot",
                header="controller | robot | e_TS after the lift [s] | steady ZMP error [mm] | "
                "ZMP to edge, least [mm] | torso, most [rad]",
                rows=tuple(
                    (
                        name,
                        fall_note(run),
                        _since(first(run.log, Mode.SL)),
                        _error(run),
                        least_margin(run),
                        float(run.log.tilt.max()),
                    )
                    for name, run in runs.items()
                ),
            ),
        ),
    )


def _since(time: float | None) -> float | None:
    # Ticks are 5 ms: digits behind the sixth are rounding.
    return None if time is None else round(time - _LIFTED, 6)


def _error(run: TeleopRun) -> float | None:
    """Return the mean error of the ZMP sideways, positive outwards over the left foot [mm]."""
    log = run.log
    rows = (log.time > _STEADY[0]) & (log.time < _STEADY[1]) & log.when(Mode.SL)
    return 1e3 * float((log.zmp - log.zmp_reference)[rows, 1].mean()) if rows.any() else None


AFTER = (0.1, 0.6, 1.1)
"""From the right device's touching the ground to the left one's lift [s]: with the paper's 1.2, 1.7
and 2.2 s, this is where its landing is at 1.1 s, as we read Figure 12."""


def switch_section(_options: StudyOptions, progress: Progress) -> Section:
    """Scenario 3: from one foot to the other, with three timings."""
    robot, steps = load_robot("biped20"), Steps(progress, len(AFTER))
    runs: dict[float, TeleopRun] = {}
    for after in AFTER:
        steps.next()
        runs[after] = run_script(robot, SCRIPTS["switch_feet"](robot, after))
    steps.finish()
    return Section(
        prose=(
            "The right foot is put down, then the left one is lifted, with three times between. "
            "Feet 0.42 m apart, CoM 0.765 m high.",
        ),
        findings=tuple(_switched("scenario 3", after, run) for after, run in runs.items()),
        figures=(
            _figure(
                "figure-12",
                "Figure 12: from SL over D and TR to SR",
                "The left device is lifted shortly after the right foot has landed, after the ZMP "
                "has reached the middle, and after CoM and ZMP have settled there.",
                [(f"lift {after:.1f} s later", run, 1) for after, run in runs.items()],
                (2.8, 6.3),
            ),
        ),
        tables=(
            Table(
                title="Switching the support foot",
                header="lift after landing [s] | robot | SR at [s] | ZMP to edge, least [mm] | "
                "torso, most [rad]",
                rows=tuple(
                    (
                        after,
                        fall_note(run),
                        first(run.log, Mode.SR, 3.0),
                        least_margin(run),
                        float(run.log.tilt.max()),
                    )
                    for after, run in runs.items()
                ),
            ),
        ),
    )


def _switched(name: str, after: float, run: TeleopRun) -> Finding:
    """Time of the left foot's lift, the end of scenario 3."""
    time = first(run.log, Mode.SR, 3.0)
    return Finding(
        name=f"{name}, lift {after:.1f} s after landing: the left foot is lifted",
        ours=time,
        unit="s",
        ok=not run.fell and time is not None,
        note="“appropriately realized” with all three timings: no fall, mode SR reached",
    )


def g1_section(options: StudyOptions, progress: Progress) -> Section:
    """Scenarios 1 to 3 on G1, with parameters scaled by the stated rules."""
    if not any(entry.name == "g1" and entry.installed for entry in catalog()):
        return Section(prose=("G1 is not installed (extra `robots`): nothing was run.",))
    robot = load_robot("g1")
    scripts = [SCRIPTS[name](robot) for name in ("over_an_obstacle", "lift_one_foot")]
    timings = AFTER[: 1 if options.quick else None]
    switches = [SCRIPTS["switch_feet"](robot, after) for after in timings]
    steps = Steps(progress, len(scripts) + len(switches))
    findings: list[Finding] = []
    rows: list[tuple[Cell, ...]] = []
    for script in (*scripts, *switches):
        steps.next()
        run = run_script(robot, script)
        undone, tilt = ", ".join(left_undone(robot, run, script)), float(run.log.tilt.max())
        if script in switches:
            after = timings[switches.index(script)]
            findings += [_switched("G1, scenario 3", after, run), _landing(after, script, run)]
        else:
            findings.append(
                Finding(
                    name=f"G1, {script.name}: largest angle of the torso",
                    ours=tilt,
                    unit="rad",
                    ok=not undone,
                    note=undone or "all was done that was led",
                )
            )
        rows.append((script.name, fall_note(run), undone or "nothing", least_margin(run), tilt))
    steps.finish()
    return Section(
        prose=("Soles of G1 are 0.17 by 0.06 m, a quarter of the paper's in width.",),
        findings=tuple(findings),
        tables=(
            Table(
                title="G1",
                header="scenario | robot | left undone | ZMP to edge, least [mm] | "
                "torso, most [rad]",
                rows=tuple(rows),
            ),
        ),
    )


def _landing(after: float, script: Script, run: TeleopRun) -> Finding:
    """Delay of the right foot's touchdown in scenario 3, which is due before the left lift."""
    down = min(point.at for point in script.points if point.right and point.right[2] < 0.0)
    landed = first(run.log, Mode.D, down)
    late = None if landed is None else landed - down
    return Finding(
        name=f"G1, scenario 3, lift {after:.1f} s after landing: the right foot lands after its "
        "device",
        paper=after,
        ours=late,
        unit="s",
        ok=late is not None and late <= after,
        note="asked: before the left device is lifted. Near the ground a foot is led at "
        "`lower_speed` or less, and a lift that comes before the other foot carries is "
        "not taken: the device has to be lowered and lifted again",
    )


_FIRST_SWING = 3.0
"""Time at which the script of scenario 4 begins to swing [s]."""

Way = Literal["forward", "sideways"]
WAYS: tuple[Way, ...] = ("forward", "sideways")

_ENOUGH = 2.0
"""Ratio without to with rotator from which on the ZMP's motion counts as “much smaller”."""

Leaders = dict[str, tuple[type[StepTeleoperator], bool]]
"""Teleoperator of a run, with or without the rotator."""

_ON, _OFF = "constant, on", "constant, off"
_WORDED_OFF = "(39c), off, as the paper's words have it"
_WEIGHTED: Leaders = {
    _ON: (StepTeleoperator, True),
    _OFF: (StepTeleoperator, False),
    "(39c), on": (PaperWeights, True),
    "(39d), off": (PaperDoubleWeights, False),
    _WORDED_OFF: (PaperWeights, False),
}
"""By Poise's rules, with its own constant weights and with the paper's."""

_COMPARED = {
    "constant weights": (_ON, _OFF),
    "(39c), (39d) without rotator": ("(39c), on", "(39d), off"),
    "(39c) always": ("(39c), on", _WORDED_OFF),
}
"""Runs that are compared, with the rotator and without it."""

_LITERAL: Leaders = {"on": (LiteralTeleoperator, True), "(39c), off": (LiteralTeleoperator, False)}
"""By the paper's rules alone, as its words have it."""


def swing_section(options: StudyOptions, progress: Progress) -> Section:
    """Scenario 4: a fast swing of a foot, with the body rotator and without."""
    robot = load_robot("biped20")
    steps = Steps(progress, (len(_WEIGHTED) + 3 * len(_LITERAL)) * len(WAYS))
    figures, findings, rows = list[Figure](), list[Finding](), list[tuple[Cell, ...]]()
    for axis, way in enumerate(WAYS):
        script = SCRIPTS["swing_fast"](robot, way, 2 if options.quick else 3)

        runs = _led(robot, script, _WEIGHTED, steps)
        rows += [_row(way, name, run, axis) for name, run in runs.items()]
        findings += _findings(way, runs, axis)
        on, off = ((f"rotator {name}", runs[f"constant, {name}"], axis) for name in ("on", "off"))
        figures.append(
            _figure(
                f"figure-14-{way}",
                f"Figure 14: swinging {way}, rotator on and off",
                "The ZMP along the swing.",
                [on, off],
                (_FIRST_SWING - 0.5, script.duration),
            )
        )
        for servos, smoothed in ((SOFT, False), (STIFF, False), (STIFF, True)):
            rules = f"the paper's rules alone, servos {servos}"
            rules += ", ZMP smoothed" if smoothed else ""
            with nullcontext() if smoothed else zmp_as_measured():
                runs = _led(robot, script, _LITERAL, steps, servos)
            rows += [_row(way, f"{rules}, {name}", run, axis) for name, run in runs.items()]
            findings.append(_rescued(f"swing {way}, {rules}", list(runs.values()), axis))
    steps.finish()
    return Section(
        prose=(
            "On the left leg the right foot is swung out and back, each way in 0.3 s. For the "
            "disabled rotator the paper says that W_A is “always set as (39c)”; we read (39d), "
            "because (39c) with the rotator's momentum at zero would still hold the angular "
            "momentum at zero, by weight. Both readings are findings. Weights are Poise's constant "
            "ones, except where (39c) or (39d) is said. The last rows of each way are the paper's "
            "rules alone, (39c) with the rotator and without it, on Poise's servos and on stiff "
            "ones, and there with a smoothed ZMP, too; numbers of a fall are left out.",
        ),
        findings=tuple(findings),
        figures=tuple(figures),
        tables=(
            Table(
                title="A fast swing",
                header="way | weights, rotator | robot | ZMP peak to peak [mm] | deviation [mm] "
                "| foot travel [mm] | foot error, rms [mm] | ZMP to edge, least [mm] "
                "| torso, most [rad]",
                rows=tuple(rows),
            ),
        ),
    )


def _led(
    robot: Robot, script: Script, leaders: Leaders, steps: Steps, servos: Servos = SOFT
) -> dict[str, TeleopRun]:
    """Run the same swing under each leader."""
    runs: dict[str, TeleopRun] = {}
    for name, (leader, rotator) in leaders.items():
        steps.next()
        runs[name] = run_script(robot, script, servos, leader=leader, rotator=rotator)
    return runs


def swings(run: TeleopRun) -> bool:
    """Return whether the right foot is in the air when the script begins to swing it."""
    return bool((run.log.when(Mode.SL) & (run.log.time > _FIRST_SWING)).any())


def _measure(run: TeleopRun, axis: int) -> tuple[float, float, float, float]:
    """Return peak-to-peak and deviation of the ZMP, travel and rms error of the foot [mm]."""
    log = run.log
    rows = log.time > _FIRST_SWING
    zmp, foot = log.zmp[rows, axis], log.soles[rows, 1, axis]
    error = foot - log.target[rows, axis]
    figures = (np.ptp(zmp), zmp.std(), np.ptp(foot), np.sqrt(np.nanmean(error * error)))
    peak, deviation, travel, rms = (1e3 * float(figure) for figure in figures)
    return peak, deviation, travel, rms


def _row(way: Way, name: str, run: TeleopRun, axis: int) -> tuple[Cell, ...]:
    numbers: tuple[Cell, ...] = (None,) * 5
    if not run.fell:
        numbers = (*_measure(run, axis), least_margin(run, _FIRST_SWING))
    swung = "" if swings(run) else ", no swing"
    return (way, name, fall_note(run) + swung, *numbers, float(run.log.tilt.max()))


def _findings(way: Way, runs: dict[str, TeleopRun], axis: int) -> list[Finding]:
    """The paper's two claims, the first with each set of weights."""
    findings: list[Finding] = []
    for weights, (on, off) in _COMPARED.items():
        stood = not (runs[on].fell or runs[off].fell)
        with_it, without = _measure(runs[on], axis), _measure(runs[off], axis)
        for k, what in enumerate(("ZMP peak to peak", "standard deviation of the ZMP")):
            ratio = without[k] / with_it[k]
            findings.append(
                Finding(
                    name=f"swing {way}, {weights}: {what} without over with rotator",
                    ours=ratio,
                    ok=stood and ratio >= _ENOUGH,
                    note=f"“much smaller with the body rotator”; asked: at least {_ENOUGH:g}",
                )
            )
    travel = _measure(runs[_ON], axis)[2] / _measure(runs[_OFF], axis)[2]
    findings.append(
        Finding(
            name=f"swing {way}: travel of the foot with over without rotator",
            paper=1.0,
            ours=travel,
            ok=not (runs[_ON].fell or runs[_OFF].fell) and abs(travel - 1.0) <= 0.1,
            note="“almost the same foot motions”; asked: within 10%",
        )
    )
    return findings


def _rescued(name: str, runs: list[TeleopRun], axis: int) -> Finding:
    """Compare runs of the paper's rules with and without the rotator."""
    on, off = runs
    note = "“effective”; asked: with it the robot swings its foot and stands. "
    stood = swings(on) and not on.fell
    if on.fell or off.fell:
        longer = float(on.log.time[-1] - off.log.time[-1])
        return Finding(
            name=f"{name}: on its feet longer with the rotator than without",
            ours=longer,
            unit="s",
            ok=stood and longer > 0.0,
            note=note + "Without it the paper's robot stands, too",
        )
    ratio = _measure(off, axis)[0] / _measure(on, axis)[0]
    return Finding(
        name=f"{name}: ZMP peak to peak without over with rotator",
        ours=ratio,
        ok=stood and ratio >= _ENOUGH,
        note=f"{note}Asked: at least {_ENOUGH:g}",
    )
